"""The drives that were possible from the starts of an experiment's trials, kept beside these.

They depend on robot and course alone, so that no trial is driven again for them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from macor_hil.experiments.drives.course import Course, on_course, possible_as_json
from macor_hil.experiments.drives.training_drive import Drive, Recordings
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.report.elements import Element, Table, Text
from macor_hil.experiments.results.store import Result, Results
from macor_hil.experiments.suite.shares import HOW_TO_READ, cell, possible_in
from macor_hil.runs.possible import said_of_starts

NAME: Final = "starts"
"""Name under which results are kept."""


@dataclass(frozen=True)
class Settings:
    """A robot and its courses."""

    drive: Drive
    """The training drive of the robot."""
    courses: Mapping[str, Course]
    """Courses by name."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """The arenas of the courses."""
        return tuple(course.arena for course in self.courses.values())


def starts_of(experiment: Experiment, out: Path) -> Experiment | None:
    """Return the experiment that finds what is possible for another one; None: it has no courses.

    Args:
        experiment: the other one.
        out: folder of recordings, results and arena files.
    """
    if experiment.courses is None:
        return None
    settings = experiment.settings
    courses = experiment.courses.of(settings, Recordings(out / "recordings", settings.drive).arenas)
    return Experiment(
        f"{NAME} of {experiment.name}",
        "",
        Settings(settings.drive, courses),
        possible,
        lambda *_: {},
        lambda *_: (),
        results=NAME,
        drives=lambda *_: (),
    )


def possible(settings: Settings, seed: int, _: Recordings) -> Result:
    """Find what is possible from the starts of every course."""
    found = {}
    for name, course in settings.courses.items():
        with on_course(course, seed, settings.drive) as track:
            found[name] = possible_as_json(track.possible(seed))
    return found


def compared(
    experiment: Experiment, results: Results, starts: Experiment, found: Results
) -> list[Element]:
    """Tell the share of what was possible, for every course and system.

    Args:
        experiment: whose trials they are, one with courses.
        results: of them.
        starts: what `starts_of` returns for it.
        found: the results of that; if a seed is missing among them, nothing is told.
    """
    if experiment.courses is None or not results.keys() <= found.keys():
        return []
    lines, said = [], []
    for name, course in starts.settings.courses.items():
        conditions: list[tuple[int, Result]] = [
            (
                seed,
                {
                    "commands": course.commands,
                    "possible": found[seed][name],
                    "trials": experiment.courses.driven(experiment.settings, result)[name],
                },
            )
            for seed, result in results.items()
        ]
        lines += [
            (f"{name}: {system}", cell(conditions, system)) for system in conditions[0][1]["trials"]
        ]
        every = [one for _, condition in conditions for one in possible_in(condition)]
        said.append(f"{name}, {course.commands} commands: {said_of_starts(every)}")
    head = ("course: system", "share of what was possible; needless collisions")
    return [
        Table("Against what was possible from the same starts", head, tuple(lines)),
        Text(f"{HOW_TO_READ} {' '.join(said)}"),
    ]
