"""Going somewhere, the paper's outlook (section 4): goals that are named after the training.

Each robot is trained in place with random commands and knows of no goal. Then it is told to drive
to what its camera can see there: the red walls of the maze's goal, a lamp, or along blue walls. A
start is a free place anywhere in the arena from which a search over the floor plan finds a way; the
others are counted. The way to the goal is compared with the shortest one.

The planner `goal` learns nothing for that but the worth of the places it knows. Systems that have
learned evaluations learn them anew: the training drive once more, each command rewarded by whether
the goal is reached after it. What they know of what follows what is kept.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from khepera_protocol.zenoh.payloads import Outline, Pose
from matplotlib.figure import Figure

from macor_hil.experiments.drives.arena_files import points_of
from macor_hil.experiments.drives.course import (
    Course,
    System,
    Track,
    on_course,
    trial_as_json,
    trial_from_json,
)
from macor_hil.experiments.drives.relearning import relearned
from macor_hil.experiments.drives.systems import (
    FORESIGHT,
    GOAL,
    GRADED,
    Learning,
    Q,
    learn_all,
    learn_foresight,
    learn_places,
)
from macor_hil.experiments.drives.training_drive import Drive, Recording, Recordings
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.rows import Row
from macor_hil.experiments.results.store import Result, Results
from macor_hil.mind.experience import Moment, Seen
from macor_hil.mind.eyes.eyes import FloorSeeing
from macor_hil.mind.planners.destinations import Destination, destination
from macor_hil.mind.planners.goal import Goal
from macor_hil.mind.planners.planner import Aim, Plan, Planner
from macor_hil.monitor.pictures import draw_way, way_windows
from macor_hil.runs.possible import Ways
from macor_hil.runs.trials import Trial

REACHED: Final = 0.95
DETOUR: Final = 1.2
"""Least share of the starts from which the goal is to be reached, and greatest way over the
shortest one."""

RELEARNING: Final = (Q, GRADED)
"""Systems that learn evaluations anew."""

_FARTHEST: Final = 250
"""Commands up to which a way is looked for."""

_DRAWS: Final = 500
"""Free places that are drawn for starts at most."""

_LENIENT: Final = 0.03
"""Metres beyond the region in which the camera may take a goal for reached."""

_DRAWN: Final = 6
"""Ways in a picture."""


class Target(NamedTuple):
    """A goal in an arena.

    Attributes:
        arena: its name.
        goal: name of the destination.
        colour: of the solids that it is; None: the arena's lamps.
        reach: metres from the middle of the robot to what it is, within which it is reached.
    """

    arena: str
    goal: str
    colour: tuple[float, float, float] | None
    reach: float

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"{self.arena}, {self.goal}"


MAZE: Final = Target("maze", "red", (0.85, 0.2, 0.2), 0.12)
LAMP: Final = Target("lamp-room", "lamp", None, 0.125)
BLUE: Final = Target("maze", "along:blue", (0.3, 0.5, 0.85), 0.12)
OPEN: Final = Target("open-box", "along:red", MAZE.colour, 0.12)


@dataclass(frozen=True)
class Settings(Learning):
    """The goals, and how they are driven to."""

    drive: Drive = field(default_factory=lambda: Drive(arena="maze"))
    """The training drive, in the arena of each goal."""
    targets: tuple[Target, ...] = (MAZE, LAMP, BLUE, OPEN)
    """The goals."""
    starts: int = 20
    """Starts from which there is a way, for each goal and robot."""
    compared: int = 5
    """The first of them, from which systems without a chart are driven, too; 0: no such systems."""
    slack: tuple[float, int] = (2.0, 40)
    """A trial has so many times the commands of the shortest way, and so many more."""
    looks: tuple[int, ...] = (0, 3_000, 13_000)
    """Frames of relearning after which systems are compared."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """The arenas of the trials."""
        return tuple(dict.fromkeys(target.arena for target in self.targets))


QUICK: Final = Settings(
    drive=Drive(arena="maze", tuning=100, random=4_000),
    targets=(MAZE,),
    starts=5,
    compared=2,
    looks=(0, 3_000),
)


class Start(NamedTuple):
    """A start, and the number of commands of the shortest way from it."""

    pose: Pose
    shortest: int


class _Told:
    """A planner whose drive ends where a goal is reached, though it may not know of it."""

    def __init__(self, planner: Planner, goal: Destination) -> None:
        self._planner = planner
        self._goal = goal

    @property
    def memory(self) -> str:
        """Name of the memory that the planner reads."""
        return self._planner.memory

    def plan(self, memory: Any, now: Moment) -> Plan:
        """Let the planner plan."""
        return self._planner.plan(memory, now)

    def aim(self, now: Moment) -> Aim | None:
        """Return the goal as it is seen."""
        if now.floor is None or now.sights is None:
            return None
        reached = bool(self._goal.reached(now.floor, now.sights))
        return Aim(self._goal.name, None, reached, not self._goal.along)


def parts(settings: Settings) -> list[Settings]:
    """Return the goals of each arena by themselves."""
    return [
        replace(settings, targets=tuple(one for one in settings.targets if one.arena == arena))
        for arena in settings.arenas
    ]


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Train a robot in each arena, and drive it to every goal there."""
    driven: list[Result] = []
    for arena in settings.arenas:
        drive = replace(settings.drive, arena=arena)
        recording = recordings.of(drive)[seed]
        old = learn_all(settings, recording) if settings.compared else {}
        places = learn_places(recording.brain, recording)
        with on_course(Course(arena=arena), seed, drive) as track:
            for target in settings.targets:
                if target.arena == arena:
                    systems = _systems(settings, destination(target.goal), recording, old)
                    own = System(places, Goal(target.goal))
                    driven.append(_driven(settings, seed, target, track, own, systems))
    return {"driven": driven}


def drives(settings: Settings, _: Path) -> list[Drive]:
    """Return the training drives of a seed: one in each arena."""
    return [replace(settings.drive, arena=arena) for arena in settings.arenas]


def _systems(
    settings: Settings, goal: Destination, recording: Recording, old: Mapping[str, System]
) -> dict[str, System]:
    """Return what the planner is compared with, by name and frames of relearning."""
    if not old:
        return {}
    foresight = learn_foresight(settings, recording)
    systems = {f"{FORESIGHT} 0": foresight}
    for name in RELEARNING:
        for frames in settings.looks:
            since = islice(_rewarded(goal, recording), frames)
            systems[f"{name} {frames}"] = relearned(settings, old[name], recording, since)
    return {name: System(one.brain, _Told(one.planner, goal)) for name, one in systems.items()}


def _rewarded(goal: Destination, recording: Recording) -> Iterator[Seen]:
    """Yield a drive whose commands earn 1 where the goal is reached after them, and else 0."""
    eyes = recording.brain.eyes
    assert isinstance(eyes, FloorSeeing)
    reached = goal.reached(eyes.floor(recording.raw), eyes.sights(recording.raw))
    for seen, there in zip(recording.seen(), reached.tolist(), strict=True):
        yield replace(seen, reinforcement=float(there and not seen.collided))


def _driven(
    settings: Settings,
    seed: int,
    target: Target,
    track: Track,
    own: System,
    systems: Mapping[str, System],
) -> Result:
    outline = track.outline()
    points = points_of(target.arena, outline, target.colour)
    ways, lenient = (track.ways(points, target.reach + more) for more in (0.0, _LENIENT))
    goal = destination(target.goal)
    starts, hopeless = _starts(settings, seed, track, ways, along=goal.along)

    def drive(system: System, count: int) -> list[Result]:
        return [
            _trial(
                settings, track, system, start, (ways, lenient), [seed, number], along=goal.along
            )
            for number, start in enumerate(starts[:count])
        ]

    return {
        "arena": target.arena,
        "goal": target.goal,
        "outline": outline.model_dump(mode="json"),
        "shortest": [start.shortest for start in starts],
        "hopeless": hopeless,
        "trials": {
            f"{GOAL} 0": drive(own, settings.starts),
            **{name: drive(system, settings.compared) for name, system in systems.items()},
        },
    }


def _starts(
    settings: Settings, seed: int, track: Track, ways: Ways, *, along: bool
) -> tuple[list[Start], int]:
    """Return starts from which there is a way, and how many of those drawn had none.

    From those of a goal that is to be kept to, no trial need end in a collision, either.
    """
    starts: list[Start] = []
    hopeless = 0
    rng = np.random.default_rng([seed, 4])
    for chance in rng.integers(2**31, size=_DRAWS).tolist():
        if len(starts) == settings.starts:
            break
        pose = track.free_place(chance)
        shortest = ways.shortest(pose, _FARTHEST)
        if shortest is None or (along and not track.is_possible(pose, _most(settings, shortest))):
            hopeless += 1
        elif shortest:
            starts.append(Start(pose, shortest))
    return starts, hopeless


def _most(settings: Settings, shortest: int) -> int:
    """Return the commands of a trial."""
    times, more = settings.slack
    return round(times * shortest) + more


def _trial(
    settings: Settings,
    track: Track,
    system: System,
    start: Start,
    ways: tuple[Ways, Ways],
    chance: Sequence[int],
    *,
    along: bool,
) -> Result:
    most = _most(settings, start.shortest)
    driven = track.drive_from(system, start.pose, most, np.random.default_rng(list(chance)))
    inside, near = (one.inside(driven.path) for one in ways)
    first = inside.index(True) if any(inside) else None
    reached = first is not None if along else driven.reached and near[-1]
    since = inside[first or 0 :]
    return {
        **trial_as_json(driven),
        "reached": reached,
        "way": (driven.length if first is None else first) if reached else None,
        "kept": round(sum(since) / len(since), 3),
    }


def _all(results: Results, target: Target) -> list[Result]:
    return [
        driven
        for result in results.values()
        for driven in result["driven"]
        if (driven["arena"], driven["goal"]) == (target.arena, target.goal)
    ]


def rows(settings: Settings, results: Results) -> Iterator[Row]:
    """Return one row for each trial."""
    for seed, result in results.items():
        for driven in result["driven"]:
            for name, trials in driven["trials"].items():
                system, frames = name.split()
                for number, one in enumerate(trials):
                    yield {
                        "arena": driven["arena"],
                        "goal": driven["goal"],
                        "seed": seed,
                        "system": system,
                        "relearned": int(frames),
                        "start": number,
                        "shortest": driven["shortest"][number],
                        "commands": len(one["r"]),
                        "asked": _most(settings, driven["shortest"][number]),
                        "way": "" if one["way"] is None else one["way"],
                        "reached": int(one["reached"]),
                        "collided": int(one["collided"]),
                        "kept": one["kept"],
                    }


def draw(settings: Settings, results: Results) -> dict[str, Figure]:
    """Draw the first ways to each goal, of the first robot."""
    first = next(iter(results))
    pictures = {}
    for target in settings.targets:
        (driven,) = _all({first: results[first]}, target)
        trials = [trial_from_json(one) for one in _shown(driven)]
        pictures[_picture(target)] = _ways(Outline.model_validate(driven["outline"]), trials)
    return pictures


def _shown(driven: Result) -> list[Result]:
    """Return the first trials that begin away from the goal."""
    away = [one for one in driven["trials"][f"{GOAL} 0"] if one["r"]]
    return away[:_DRAWN]


def _picture(target: Target) -> str:
    return f"{target.arena}-{target.goal.replace(':', '-')}"


def _ways(outline: Outline, trials: Sequence[Trial]) -> Figure:
    columns = min(3, len(trials))
    lines = -(-len(trials) // columns)
    window, *_ = way_windows([(outline, one) for one in trials])
    (x0, x1), (y0, y1) = window
    height = 3.4 * (y1 - y0) / (x1 - x0) + 0.8
    figure = Figure(figsize=(3.4 * columns + 0.6, height * lines + 0.4), layout="constrained")
    axes = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for place in axes[len(trials) :]:
        place.set_axis_off()
    for one, place in zip(trials, axes, strict=False):
        draw_way(place, outline, one, window)
        end = "collision" if one.collided else "no collision"
        place.set_title(f"{one.length} commands,\n{end}")
    return figure


def tell(settings: Settings, results: Results) -> list[Element]:
    """Tell from how many starts each goal was reached, and by which way."""
    return [
        Text(
            f"{len(results)} training seeds, each another robot;"
            f" {settings.drive.random:,} random commands of training in place; {settings.starts}"
            " starts for each goal, anywhere in the arena's free strip, from which there is a way;"
            " for goals that are kept to, also one on which no command of a trial ends in a"
            " collision. Such a goal is reached when the robot comes to it; kept is the share of"
            " the poses after that which are near it, driven that of the trial's commands."
            f" A trial ends at the goal, with a collision, or after {settings.slack[0]:g} times"
            f" the commands of the shortest way and {settings.slack[1]} more. The way counts to the"
            " first place at which the goal is near; the target is"
            f" {100 * REACHED:.0f} % reached and {DETOUR:g} times the shortest way."
        ),
        _table(settings, results),
        *(_compared(settings, results, each) for each in settings.targets if settings.compared),
        *(Picture(_picture(target), _caption(results, target)) for target in settings.targets),
    ]


def _caption(results: Results, target: Target) -> str:
    driven = _all({(first := next(iter(results))): results[first]}, target)[0]
    shown = _shown(driven)
    return (
        f"{target.name}: the first {len(shown)} ways of the first robot, from the filled circle;"
        f" {sum(one['reached'] for one in shown)} of them end at the goal."
    )


def _table(settings: Settings, results: Results) -> Table:
    lines = []
    for target in settings.targets:
        everything = _all(results, target)
        trials = [
            (one, shortest)
            for driven in everything
            for one, shortest in zip(driven["trials"][f"{GOAL} 0"], driven["shortest"], strict=True)
        ]
        reached = [(one, shortest) for one, shortest in trials if one["reached"]]
        ways = sum(one["way"] for one, _ in reached)
        shortest = sum(least for _, least in reached)
        kept = [one["kept"] for one, _ in reached]
        shares = [len(one["r"]) / _most(settings, least) for one, least in trials]
        along = destination(target.goal).along
        lines.append(
            (
                target.name,
                str(len(trials)),
                str(sum(driven["hopeless"] for driven in everything)),
                f"{100 * len(reached) / max(len(trials), 1):.1f} %",
                f"{100 * sum(one['collided'] for one, _ in trials) / max(len(trials), 1):.1f} %",
                f"{ways / max(shortest, 1):.2f}",
                f"{100 * float(np.mean(kept)):.0f} %" if kept and along else "-",
                f"{100 * float(np.mean(shares)):.0f} %" if along else "-",
            )
        )
    head = (
        *("goal", "starts", "without a way", "reached", "collided", "way / shortest"),
        *("kept", "driven of what was possible"),
    )
    return Table("The planner goal, nothing relearned", head, tuple(lines))


def _compared(settings: Settings, results: Results, target: Target) -> Table:
    """Return how often systems reach a goal, by frames of relearning."""
    everything = _all(results, target)
    lines = []
    for name in (GOAL, FORESIGHT, *RELEARNING):
        cells = []
        for frames in settings.looks:
            trials = [
                one
                for driven in everything
                for one in driven["trials"].get(f"{name} {frames}", [])[: settings.compared]
            ]
            share = 100 * sum(one["reached"] for one in trials) / max(len(trials), 1)
            cells.append(f"{share:.0f} % of {len(trials)}" if trials else "-")
        lines.append((name, *cells))
    head = ("system", *(f"after {frames:,}" for frames in settings.looks))
    return Table(f"{target.name}: reached, by frames since the goal changed", head, tuple(lines))


DESTINATIONS: Final = Experiment(
    "destinations",
    "Going somewhere: goals named after the training",
    Settings(),
    trial,
    draw,
    tell,
    most_seeds=10,
    quick=QUICK,
    rows=rows,
    drives=drives,
    parts=parts,
)
