"""The suite of arenas: what each system drives of what is possible, in place and elsewhere.

In place: trained where it is driven, in every bundled arena, in each with a colour of its own on
every wall, and in generated ones; bundled ones are driven under other light, too. Elsewhere:
trained on a mixture of generated arenas, and driven in generated ones that are not among them. A
search over the floor plan tells how many commands are possible from each start.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from khepera_protocol.zenoh.payloads import Outline
from matplotlib.figure import Figure

from macor_hil.experiments.drives.arena_files import Place, bundled_arenas
from macor_hil.experiments.drives.course import Course, Lighting, System
from macor_hil.experiments.drives.systems import (
    ANTICIPATIVE,
    EXPECTED,
    FITTED_Q,
    FORESIGHT,
    GRADED,
    REACTIVE,
    SUCCESSOR,
    Q,
    learn_all,
)
from macor_hil.experiments.drives.training_drive import QUICK_DRIVE, Drive, Recording, Recordings
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.rows import Row
from macor_hil.experiments.results.store import Result, Results
from macor_hil.experiments.suite import in_place
from macor_hil.experiments.suite.in_place import Conditions, InPlace, by_name
from macor_hil.experiments.suite.share_map import HOW_TO_READ_MAP, share_map
from macor_hil.experiments.suite.shares import (
    HOW_TO_READ,
    cell,
    compared_rows,
    drive_all,
    first_trial,
    shares_by_seed,
)
from macor_hil.hardware.cameras.light import AS_TRAINED, LIGHTS
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.experience import Moment
from macor_hil.mind.planners.planner import NO_PLAN, Plan
from macor_hil.monitor.pictures import trials_figure

RANDOM: Final = "random"

SYSTEMS: Final = (
    RANDOM,
    REACTIVE,
    Q,
    SUCCESSOR,
    FITTED_Q,
    ANTICIPATIVE,
    EXPECTED,
    GRADED,
    FORESIGHT,
)

DRAWN: Final = (REACTIVE, EXPECTED, GRADED, FORESIGHT)

IN_PLACE: Final = "in place"
ELSEWHERE: Final = "on a mixture"

GOALS: Final = {IN_PLACE: (0.99, 0.01), ELSEWHERE: (0.95, 0.05)}
"""Least share of what is possible, and greatest share of needless collisions, to be reached."""


def _homes() -> tuple[Place, ...]:
    bundled = (Place(name, own) for name in bundled_arenas() for own in (False, True))
    return (*bundled, *map(Place, range(15)))  # each kind in each difficulty


@dataclass(frozen=True)
class Settings(InPlace):
    """Settings of the suite: trainings, arenas and trials.

    All drives of the mixture together are as long as one in place.
    """

    homes: tuple[Place, ...] = field(default_factory=_homes)
    """Arenas of training and of trials: all bundled ones, each also with a colour of its own on
    every wall, and generated ones."""
    mixture: tuple[int, ...] = tuple(range(100, 108))
    """Seeds of the generated arenas of the mixture."""
    unseen: tuple[int, ...] = tuple(range(15))
    """Seeds of generated arenas that are driven after training on the mixture."""
    lights: tuple[Lighting, ...] = tuple(name for name in LIGHTS if name != AS_TRAINED)
    """Lights that systems are driven in beside the one of their training, where an arena is driven
    as it comes."""


QUICK: Final = Settings(
    drive=QUICK_DRIVE,
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


def drives(settings: Settings, arenas: Path) -> list[Drive]:
    """Return the training drives of a seed: in every home, and those of the mixture."""
    mixture = _mixture(settings, arenas) if settings.unseen else []
    return in_place.drives(settings, arenas) + mixture


def parts(settings: Settings) -> list[Settings]:
    """Return each home by itself, and the mixture with all that is driven after it."""
    homes = in_place.parts(replace(settings, mixture=(), unseen=()))
    if not (settings.mixture and settings.unseen):
        return homes
    return [*homes, replace(settings, homes=(), lights=())]


def lights_of(settings: Settings, place: Place) -> tuple[str, ...]:
    """Return the lights that an arena is driven in after training there."""
    return (AS_TRAINED, *(settings.lights if place.shipped else ()))


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Train and drive all systems of a seed in all arenas."""
    files = recordings.arenas
    driven: list[Result] = []
    for place in settings.homes:
        drive = replace(settings.drive, arena=place.file(files))
        systems = _systems(settings, recordings.of(drive)[seed])
        driven += [
            _driven(settings, systems, seed, IN_PLACE, place, files, light)
            for light in lights_of(settings, place)
        ]
    if settings.mixture and settings.unseen:
        parts = [recordings.of(drive)[seed] for drive in _mixture(settings, files)]
        systems = _systems(settings, _mixed(settings, seed, parts))
        for number in settings.unseen:
            where = Place(number)
            driven.append(_driven(settings, systems, seed, ELSEWHERE, where, files, AS_TRAINED))
    return {"driven": driven}


def _systems(settings: Settings, recording: Recording) -> dict[str, System]:
    systems = learn_all(settings, recording, [name for name in SYSTEMS if name != RANDOM])
    systems[RANDOM] = System(systems[REACTIVE].brain, Aimless())
    return {name: systems[name] for name in SYSTEMS}


def _mixture(settings: Settings, files: Path) -> list[Drive]:
    """Return the drives of the mixture, together as long as one in place."""
    if not settings.mixture:
        return []
    part = replace(settings.drive, random=settings.drive.random // len(settings.mixture))
    return [replace(part, arena=Place(number).file(files)) for number in settings.mixture]


def _mixed(settings: Settings, seed: int, parts: Sequence[Recording]) -> Recording:
    """Return drives in several arenas as one; eyes and prototypes are tuned to all of them."""
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
    where = {"trained": trained, "arena": place.name, "look": place.look, "light": light}
    return where | drive_all(systems, course, seed, settings.drive)


def _conditions(results: Results, wanted: Callable[[Result], bool]) -> Conditions:
    return [
        (seed, condition)
        for seed, result in results.items()
        for condition in result["driven"]
        if wanted(condition)
    ]


def rows(_: Settings, results: Results) -> Iterator[Row]:
    """Yield one row for each trial."""
    for seed, condition in _conditions(results, lambda _: True):
        for system in condition["trials"]:
            places = {name: condition[name] for name in ("trained", "arena", "look", "light")}
            yield from compared_rows(condition, system, {**places, "seed": seed, "system": system})


def draw(_: Settings, results: Results) -> dict[str, Figure]:
    """Draw all shares, and the first trial of some systems in every arena, of the first seed."""
    pictures = {chapter.picture: share_map(chapter.rows, SYSTEMS) for chapter in _chapters(results)}
    for driven in next(iter(results.values()))["driven"]:
        if driven["light"] == AS_TRAINED:
            outline = Outline.model_validate(driven["outline"])
            shown = {name: (outline, first_trial(driven, name)) for name in DRAWN}
            pictures[_picture(driven)] = trials_figure(shown)
    return pictures


def _picture(driven: Result) -> str:
    parts = (driven["trained"], driven["arena"], driven["look"])
    return "-".join(part.replace(" ", "-") for part in parts)


def tell(settings: Settings, results: Results) -> list[Element]:
    """Tell what each system drives of what is possible."""
    drive = settings.drive
    blocks: list[Element] = [
        Text(
            f"{len(results)} training seeds, each another robot; {drive.random:,} random commands"
            f" of training, {settings.nodes} nodes; {settings.course.trials} trials of at most"
            f" {settings.course.commands} commands from starts near each arena's own."
            f" {HOW_TO_READ}"
        )
    ]
    for chapter in _chapters(results):
        blocks.append(Picture(chapter.picture, f"{chapter.title}. {HOW_TO_READ_MAP}"))
        blocks.append(_table(chapter))
    blocks.append(Text(_verdict(results)))
    first = next(iter(results.values()))["driven"]
    shown = [one for one in first if one["light"] == AS_TRAINED]
    return blocks + [Picture(_picture(one), _caption(one)) for one in shown]


def _caption(driven: Result) -> str:
    unhurt = [name for name in DRAWN if not first_trial(driven, name).collided]
    without = " and ".join(unhurt) if unhurt else "nobody"
    return (
        f"First trials in {driven['arena']}, {driven['look']}, trained {driven['trained']}; a cross"
        f" marks a collision. Without one: {without}."
    )


@dataclass(frozen=True, slots=True)
class _Chapter:
    """Conditions that a table and a picture compare, by the names of their rows."""

    title: str
    picture: str
    by: str
    rows: dict[str, Conditions]


def _chapters(results: Results) -> list[_Chapter]:
    """Return what there are results of: in place, under other light, elsewhere."""
    found = (
        ("Trained in place", "shares-in-place", _in_place(results), ("arena", "look")),
        (
            "The same, driven under other light",
            "shares-other-light",
            _conditions(results, lambda one: one["light"] != AS_TRAINED),
            ("light",),
        ),
        (
            "Trained on a mixture, driven where it never was",
            "shares-on-a-mixture",
            _elsewhere(results),
            ("arena",),
        ),
    )
    return [
        _Chapter(title, picture, ", ".join(by), _with_all(by_name(conditions, *by)))
        for title, picture, conditions, by in found
        if conditions
    ]


def _in_place(results: Results) -> Conditions:
    return _conditions(
        results, lambda one: one["trained"] == IN_PLACE and one["light"] == AS_TRAINED
    )


def _elsewhere(results: Results) -> Conditions:
    return _conditions(results, lambda one: one["trained"] == ELSEWHERE)


def _with_all(groups: dict[str, Conditions]) -> dict[str, Conditions]:
    """Add a last row of all together, where there are several."""
    if len(groups) == 1:
        return groups
    return groups | {"all": [one for group in groups.values() for one in group]}


def _table(chapter: _Chapter) -> Table:
    cells = tuple(
        (name, *(cell(group, system) for system in SYSTEMS)) for name, group in chapter.rows.items()
    )
    return Table(chapter.title, (chapter.by, *SYSTEMS), cells)


def _verdict(results: Results) -> str:
    said = []
    for trained, conditions in ((IN_PLACE, _in_place(results)), (ELSEWHERE, _elsewhere(results))):
        if not conditions:
            continue
        least, most = GOALS[trained]
        groups = by_name(conditions, "arena", "look")
        missed = []
        for name, group in groups.items():
            shares, needless = shares_by_seed(group, FORESIGHT)
            fails = shares and np.mean(shares) < least, needless and np.mean(needless) > most
            if any(fails):
                missed.append(name)
        goal = f"at least {100 * least:.0f} % and at most {100 * most:.0f} % needless collisions"
        held = (
            f"holds in all {len(groups)} arenas" if not missed else f"fails in {'; '.join(missed)}"
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
    drives=drives,
    parts=parts,
)
