"""Ablation of foresight: trained and driven in place, with one part changed at a time.

Everything is learned from the recordings of the suite's arenas, once for all changes; what is
changed is what the planner is given of that, and how far ahead it looks.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from textwrap import fill
from typing import Any, Final

import numpy as np
from khepera_protocol.zenoh.payloads import Outline
from matplotlib.figure import Figure

from macor_hil.arrays import Array
from macor_hil.experiments.drives.arena_files import Place
from macor_hil.experiments.drives.course import Course, System
from macor_hil.experiments.drives.systems import FORESIGHT, learn_foresight
from macor_hil.experiments.drives.training_drive import QUICK_DRIVE, Recording, Recordings
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.rows import Row
from macor_hil.experiments.results.store import Result, Results
from macor_hil.experiments.suite.in_place import InPlace, by_arena, driven, drives, parts
from macor_hil.experiments.suite.shares import (
    HOW_TO_READ,
    cell,
    compared_rows,
    first_trial,
)
from macor_hil.mind.experience import Moment
from macor_hil.mind.foresight.collisions import Curve
from macor_hil.mind.foresight.skill import Skill
from macor_hil.mind.memories.foresight import ForesightMemory
from macor_hil.mind.planners.foresight import Foresight
from macor_hil.mind.planners.planner import Plan, Planner
from macor_hil.monitor.pictures import trials_figure

AS_IT_IS: Final = "as it is, 42 commands ahead"
AVERAGED: Final = "distances averaged over 30 degrees"
A_LIMIT: Final = "a limit to the clearance instead of chances"

_SECTORS: Final = 12
_SHARP: Final = 1e-3
"""Spread in heights of a curve that is a limit."""


class Changed:
    """Foresight that is given another skill than was learned, or sees other distances."""

    memory = FORESIGHT

    def __init__(
        self,
        skill: Skill | None,
        see: Callable[[Array], Array] = lambda floor: floor,
    ) -> None:
        self.skill = skill
        self._see = see
        self._foresight = Foresight()

    def plan(self, _memory: Any, now: Moment) -> Plan:
        """Evaluate the commands by what it is given."""
        floor = None if now.floor is None else self._see(now.floor)
        return self._foresight.plan(self, replace(now, floor=floor))


def averaged(floor: Array) -> Array:
    """Return a profile of the same shape, (directions,), with one mean in every 30 degrees."""
    sector = np.arange(len(floor)) * _SECTORS // len(floor)
    means = np.bincount(sector, floor) / np.bincount(sector)
    return np.asarray(means[sector])


def _ahead(commands: int) -> Callable[[Skill | None], Planner]:
    return lambda _: Foresight(ahead=commands)


def _with_curve(change: Callable[[Curve], Curve]) -> Callable[[Skill | None], Planner]:
    return lambda skill: Changed(skill and replace(skill, curve=change(skill.curve)))


CHANGES: Final[Mapping[str, Callable[[Skill | None], Planner]]] = {
    AS_IT_IS: lambda _: Foresight(),
    "22 commands ahead": _ahead(22),
    "14 commands ahead": _ahead(14),
    "10 commands ahead": _ahead(10),
    "6 commands ahead": _ahead(6),
    "1 command ahead": _ahead(1),
    "hidden places cost nothing": lambda _: Foresight(hazard=0.0),
    "hidden places cost three times as much": lambda _: Foresight(hazard=0.09),
    "as sure of what is far ahead": _with_curve(lambda curve: replace(curve, grows=0.0)),
    A_LIMIT: _with_curve(lambda curve: Curve(curve.reach, _SHARP, 0.0)),
    AVERAGED: lambda skill: Changed(skill, averaged),
}

DRAWN: Final = (AS_IT_IS, "6 commands ahead", A_LIMIT, AVERAGED)


@dataclass(frozen=True)
class Settings(InPlace):
    """Arenas that the changes are tried in."""

    homes: tuple[Place, ...] = (Place("maze"), Place("hairpin"), Place("narrow-passage"))
    """Arenas of training and of trials, in which others than foresight fail."""
    course: Course = field(default_factory=lambda: Course(trials=5))
    """The trials of each change in each arena."""


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Learn from the drives of a seed, and drive the trials of all changes."""
    return driven(settings, seed, recordings, _systems)


def _systems(settings: Settings, recording: Recording, _: int) -> dict[str, System]:
    brain = learn_foresight(settings, recording).brain
    memory = brain.memories[FORESIGHT]
    assert isinstance(memory, ForesightMemory)
    return {name: System(brain, made(memory.skill)) for name, made in CHANGES.items()}


def rows(_: Settings, results: Results) -> Iterator[Row]:
    """Yield one row for each trial."""
    for seed, result in results.items():
        for one in result["driven"]:
            where = {"arena": one["arena"], "look": one["look"], "seed": seed}
            for change in one["trials"]:
                yield from compared_rows(one, change, {**where, "change": change})


def draw(_: Settings, results: Results) -> dict[str, Figure]:
    """Draw the first trial of some changes in every arena, of the first seed."""
    first = next(iter(results.values()))["driven"]
    return {
        _picture(one): trials_figure(
            {
                fill(name, 30): (
                    Outline.model_validate(one["outline"]),
                    first_trial(one, name),
                )
                for name in DRAWN
            }
        )
        for one in first
    }


def _picture(one: Result) -> str:
    return f"{one['arena']} {one['look']}".replace(" ", "-")


def tell(settings: Settings, results: Results) -> list[Element]:
    """Tell what each change costs."""
    groups = by_arena(results)
    lines = tuple(
        (name, *(cell(conditions, name) for conditions in groups.values())) for name in CHANGES
    )
    shown = next(iter(results.values()))["driven"]
    return [
        Text(
            f"{len(results)} training seeds, each another robot; {settings.drive.random:,} random"
            f" commands of training, trained and driven in the same arena;"
            f" {settings.course.trials} trials of at most {settings.course.commands} commands."
            f" One part of foresight is changed at a time. {HOW_TO_READ}"
        ),
        Table("Foresight with one part changed", ("change", *groups), lines),
        *(
            Picture(_picture(one), f"First trials in {one['arena']}; a cross marks a collision.")
            for one in shown
        ),
    ]


QUICK: Final = Settings(
    drive=QUICK_DRIVE,
    homes=(Place("maze"), Place("hairpin")),
    course=Course(trials=2),
)

ABLATION: Final = Experiment(
    "ablation",
    "What each part of foresight gives",
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
