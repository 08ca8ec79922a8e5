"""Experiments that train in some arenas and drive there: what they have in common."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from macor_hil.experiments.drives.arena_files import Place, shipped
from macor_hil.experiments.drives.course import Course, System
from macor_hil.experiments.drives.systems import Learning
from macor_hil.experiments.drives.training_drive import Drive, Recording, Recordings
from macor_hil.experiments.results.store import Result, Results
from macor_hil.experiments.suite.shares import drive_all


@dataclass(frozen=True)
class InPlace(Learning):
    """Arenas of training and of trials."""

    drive: Drive = field(default_factory=Drive)
    """The training drive in each arena."""
    homes: tuple[Place, ...] = (Place("corridor"), Place("maze"), Place("hairpin"))
    """Arenas of training and of trials."""
    course: Course = field(default_factory=Course)
    """The trials of each system in each arena."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """Arenas that come as files; all others follow from code."""
        return shipped(self.homes)


Conditions = list[tuple[int, Result]]
"""Results of systems in one arena, each with its training seed."""

Settings = TypeVar("Settings", bound=InPlace)


def drives(settings: InPlace, arenas: Path) -> list[Drive]:
    """Return the training drives of a seed."""
    return [replace(settings.drive, arena=place.file(arenas)) for place in settings.homes]


def parts(settings: Settings) -> list[Settings]:
    """Return each home by itself."""
    return [replace(settings, homes=(home,)) for home in settings.homes]


def driven(
    settings: Settings,
    seed: int,
    recordings: Recordings,
    learn: Callable[[Settings, Recording, int], Mapping[str, System]],
) -> Result:
    """Learn systems from the drives of a seed, and drive the trials of all of them in place."""
    conditions: list[Result] = []
    for place in settings.homes:
        arena = place.file(recordings.arenas)
        systems = learn(settings, recordings.of(replace(settings.drive, arena=arena))[seed], seed)
        course = replace(settings.course, arena=arena)
        condition = drive_all(systems, course, seed, settings.drive)
        conditions.append({"arena": place.name, "look": place.look} | condition)
    return {"driven": conditions}


def by_arena(results: Results) -> dict[str, Conditions]:
    """Return the conditions of results by arena and look."""
    conditions = [(seed, one) for seed, result in results.items() for one in result["driven"]]
    return by_name(conditions, "arena", "look")


def by_name(conditions: Conditions, *by: str) -> dict[str, Conditions]:
    """Group conditions by some of what they are called."""
    groups: dict[str, Conditions] = {}
    for seed, one in conditions:
        groups.setdefault(", ".join(one[name] for name in by), []).append((seed, one))
    return groups
