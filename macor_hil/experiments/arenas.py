"""The suite of arenas: what each system drives of what is possible, in place and elsewhere.

In place: trained where it is driven, in every bundled arena, in each with a colour of its own on
every wall, and in generated ones; and driven there under other light than in training. Elsewhere:
trained on a mixture of generated arenas, and driven in generated ones that are not among them. A
search over the floor plan tells how many commands are possible from each start.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from khepera_protocol.zenoh.payloads import Outline
from matplotlib.figure import Figure

from macor_hil.experiments.drives.arena_files import Place, bundled_arenas
from macor_hil.experiments.drives.course import (
    Course,
    System,
    on_course,
    trial_as_json,
    trial_from_json,
)
from macor_hil.experiments.drives.systems import (
    ANTICIPATIVE,
    EXPECTED,
    FORESIGHT,
    GRADED,
    REACTIVE,
    Learning,
    Q,
    learn_all,
    learn_foresight,
)
from macor_hil.experiments.drives.training_drive import Drive, Recording, Recordings
from macor_hil.experiments.experiment import Experiment, Row
from macor_hil.experiments.report.drawing import draw_trials
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.results.store import Result, Results
from macor_hil.hardware.cameras.light import AS_TRAINED, LIGHTS
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.experience import Moment
from macor_hil.mind.planners.planner import NO_PLAN, Plan
from macor_hil.runs.possible import Possible, Shares, compare, share_of
from macor_hil.runs.trials import Trial

RANDOM: Final = "random"

SYSTEMS: Final = (RANDOM, REACTIVE, Q, ANTICIPATIVE, EXPECTED, GRADED, FORESIGHT)

DRAWN: Final = (REACTIVE, EXPECTED, GRADED, FORESIGHT)

IN_PLACE: Final = "in place"
ELSEWHERE: Final = "on a mixture"

GOALS: Final = {IN_PLACE: (0.99, 0.01), ELSEWHERE: (0.95, 0.05)}
"""Least share of what is possible, and greatest share of needless collisions, to be reached."""


def _homes() -> tuple[Place, ...]:
    bundled = (Place(name, own) for name in bundled_arenas() for own in (False, True))
    return (*bundled, *map(Place, range(15)))  # each kind in each difficulty


@dataclass(frozen=True)
class Settings(Learning):
    """Settings of the suite: trainings, arenas and trials."""

    drive: Drive = field(default_factory=Drive)
    """The training drive in each arena; of a mixture all drives together are as long."""
    homes: tuple[Place, ...] = field(default_factory=_homes)
    """Arenas of training and of trials: all bundled ones, each also with a colour of its own on
    every wall, and generated ones."""
    mixture: tuple[int, ...] = tuple(range(100, 108))
    """Seeds of the generated arenas of the mixture."""
    unseen: tuple[int, ...] = tuple(range(15))
    """Seeds of generated arenas that are driven after training on the mixture."""
    lights: tuple[str, ...] = tuple(name for name in LIGHTS if name != AS_TRAINED)
    """Lights that systems are driven in beside the one of their training."""
    course: Course = field(default_factory=Course)
    """The trials of each system in each arena."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """Arenas that come as files; all others follow from code."""
        return tuple(dict.fromkeys(p.arena for p in self.homes if isinstance(p.arena, str)))


QUICK: Final = Settings(
    drive=Drive(tuning=100, random=1_500),
    homes=(
        Place("corridor"),
        Place("corridor", own_colours=True),
        Place("maze"),
        Place("narrow-passage"),
        Place("hairpin"),
        Place(0),
    ),
    mixture=(100, 101, 102),
    unseen=(0, 1, 2),
    lights=(),
    course=Course(trials=3),
)


class Aimless:
    """Knows no command, so that one is drawn."""

    memory = "transitions"

    def plan(self, _memory: Any, _now: Moment) -> Plan:
        """Evaluate nothing."""
        return NO_PLAN


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Train and drive all systems of a seed in all arenas."""
    folder = recordings.folder.parent
    files = folder.parent / "arenas"
    driven: list[Result] = []
    for place in settings.homes:
        drive = replace(settings.drive, arena=place.file(files))
        systems = _systems(settings, Recordings(folder, drive)[seed])
        driven += [
            _driven(settings, systems, seed, IN_PLACE, place, files, light)
            for light in (AS_TRAINED, *settings.lights)
        ]
    if settings.mixture and settings.unseen:
        systems = _systems(settings, _mixed(settings, seed, folder, files))
        for number in settings.unseen:
            where = Place(number)
            driven.append(_driven(settings, systems, seed, ELSEWHERE, where, files, AS_TRAINED))
    return {"driven": driven}


def _systems(settings: Settings, recording: Recording) -> dict[str, System]:
    systems = learn_all(settings, recording)
    brain = systems[REACTIVE].brain
    systems[FORESIGHT] = learn_foresight(brain, recording)
    systems[RANDOM] = System(brain, Aimless())
    return {name: systems[name] for name in SYSTEMS}


def _mixed(settings: Settings, seed: int, folder: Path, files: Path) -> Recording:
    """Return drives in several arenas as one; eyes and prototypes are tuned to all of them."""
    count = len(settings.mixture)
    part = replace(settings.drive, random=settings.drive.random // count)
    drives = [replace(part, arena=Place(number).file(files)) for number in settings.mixture]
    parts = [Recordings(folder, drive)[seed] for drive in drives]
    brain = build_brain(settings.drive.brain)
    raw = np.concatenate([one.raw for one in parts])
    step = max(1, len(raw) // settings.drive.tuning)
    brain.tune(raw[::step], np.random.default_rng(seed))
    return Recording(
        brain,
        raw,
        np.concatenate([one.commands for one in parts]),
        np.concatenate([one.collided for one in parts]),
        round(sum(one.robot_seconds for one in parts), 3),
    )


def _driven(
    settings: Settings,
    systems: Mapping[str, System],
    seed: int,
    trained: str,
    place: Place,
    files: Path,
    light: str,
) -> Result:
    course = replace(settings.course, arena=place.file(files), light=light)
    with on_course(course, seed, settings.drive.drift) as track:
        trials = {name: track.drive(system, seed) for name, system in systems.items()}
        possible = track.possible(next(iter(trials.values())))
        outline = track.outline().model_dump(mode="json")
    return {
        "trained": trained,
        "arena": place.name,
        "look": place.look,
        "light": light,
        "outline": outline if light == AS_TRAINED else None,
        "possible": [[one.length, one.exact] for one in possible],
        "trials": {name: [trial_as_json(one) for one in of] for name, of in trials.items()},
    }


def _conditions(results: Results) -> list[Result]:
    return [driven for result in results.values() for driven in result["driven"]]


def _possible(settings: Settings, driven: Result) -> list[Possible]:
    most = settings.course.commands
    return [Possible(length, most, exact) for length, exact in driven["possible"]]


def _trials(driven: Result, system: str) -> list[Trial]:
    return [trial_from_json(one) for one in driven["trials"][system]]


def rows(settings: Settings, results: Results) -> Iterator[Row]:
    """Return one row for each trial."""
    for seed, result in results.items():
        for driven in result["driven"]:
            possible = _possible(settings, driven)
            for system in driven["trials"]:
                pairs = zip(_trials(driven, system), possible, strict=True)
                for number, (one, most) in enumerate(pairs):
                    share = share_of(one, most)
                    yield {
                        "trained": driven["trained"],
                        "arena": driven["arena"],
                        "look": driven["look"],
                        "light": driven["light"],
                        "seed": seed,
                        "system": system,
                        "trial": number,
                        "commands": one.length,
                        "collided": int(one.collided),
                        "touched": int(one.touched),
                        "reinforcement": round(one.total, 3),
                        "possible": most.length,
                        "certain": int(most.exact),
                        "share": "" if share is None else round(share, 4),
                    }


def draw(_: Settings, results: Results) -> dict[str, Figure]:
    """Draw the first trial of some systems in every arena, of the first seed."""
    pictures = {}
    for driven in next(iter(results.values()))["driven"]:
        if driven["light"] == AS_TRAINED:
            outline = Outline.model_validate(driven["outline"])
            shown = {name: (outline, _trials(driven, name)[0]) for name in DRAWN}
            pictures[_picture(driven)] = draw_trials(shown)
    return pictures


def _picture(driven: Result) -> str:
    parts = (driven["trained"], driven["arena"], driven["look"])
    return "-".join(part.replace(" ", "-") for part in parts)


def tell(settings: Settings, results: Results) -> list[Element]:
    """Tell what each system drives of what is possible."""
    drive = settings.drive
    everything = _conditions(results)
    home = [one for one in everything if one["trained"] == IN_PLACE]
    plain = [one for one in home if one["light"] == AS_TRAINED]
    lit = [one for one in home if one["light"] != AS_TRAINED]
    away = [one for one in everything if one["trained"] == ELSEWHERE]
    blocks: list[Element] = [
        Text(
            f"{len(results)} training seeds, each another robot; {drive.random:,} random commands"
            f" of training, {settings.nodes} nodes; {settings.course.trials} trials of at most"
            f" {settings.course.commands} commands from starts near each arena's own. A cell is"
            " the share of the commands that were possible from the same starts, and the share of"
            " trials that collided among those in which no collision was necessary."
        ),
        _table(settings, "Trained in place", plain, "arena", "look"),
        *([_table(settings, "The same, driven under other light", lit, "light")] if lit else []),
        _table(settings, "Trained on a mixture, driven where it never was", away, "arena"),
        Text(_verdict(settings, plain, away)),
    ]
    first = next(iter(results.values()))["driven"]
    shown = [one for one in first if one["light"] == AS_TRAINED]
    return blocks + [
        Picture(_picture(one), f"{one['arena']}, {one['look']}, trained {one['trained']}.")
        for one in shown
    ]


def _shares(settings: Settings, driven: Sequence[Result], system: str) -> Shares:
    trials = [one for each in driven for one in _trials(each, system)]
    return compare(trials, [one for each in driven for one in _possible(settings, each)])


def _cell(shares: Shares) -> str:
    share = "-" if shares.share is None else f"{100 * shares.share:.1f} %"
    needless = f"{100 * shares.needless / shares.free:.0f} %" if shares.free else "-"
    return f"{share}; {needless}"


def _table(settings: Settings, title: str, driven: Sequence[Result], *by: str) -> Table:
    groups: dict[tuple[str, ...], list[Result]] = {}
    for one in driven:
        groups.setdefault(tuple(one[name] for name in by), []).append(one)
    lines = [(", ".join(key), group) for key, group in groups.items()]
    if len(lines) > 1:
        lines.append(("all", list(driven)))
    cells = tuple(
        (name, *(_cell(_shares(settings, group, system)) for system in SYSTEMS))
        for name, group in lines
    )
    return Table(title, (", ".join(by), *SYSTEMS), cells)


def _verdict(settings: Settings, plain: Sequence[Result], away: Sequence[Result]) -> str:
    said = []
    for trained, driven in ((IN_PLACE, plain), (ELSEWHERE, away)):
        least, most = GOALS[trained]
        missed = []
        names = dict.fromkeys((one["arena"], one["look"]) for one in driven)
        for name in names:
            here = [one for one in driven if (one["arena"], one["look"]) == name]
            shares = _shares(settings, here, FORESIGHT)
            needless = shares.needless / shares.free if shares.free else 0.0
            if (shares.share is not None and shares.share < least) or needless > most:
                missed.append(", ".join(name))
        goal = f"at least {100 * least:.0f} % and at most {100 * most:.0f} % needless collisions"
        held = (
            f"holds in all {len(names)} arenas" if not missed else f"fails in {'; '.join(missed)}"
        )
        said.append(f"Trained {trained}, {FORESIGHT} is asked for {goal}, which {held}.")
    return " ".join(said)


ARENAS: Final = Experiment(
    "arenas",
    "A suite of arenas: what is driven of what is possible",
    Settings(),
    trial,
    draw,
    tell,
    most_seeds=10,
    quick=QUICK,
    rows=rows,
)
