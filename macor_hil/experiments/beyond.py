"""Beyond the paper: what each change to the planner gives, where it was trained and where not.

The same trainings as in table 1. From the paper's wave, which takes the best outcome that ever
occurred, over outcomes weighed by their counts (`expected`), to graded situations on Fuzzy ART's
nodes, on as many prototypes placed by k-means, and to experience that counts as its mirror image,
too (`graded`); each in the corridor that it was trained in, from the start and from anywhere, and
in arenas that it has never seen.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from khepera_protocol.zenoh.payloads import Outline
from matplotlib.figure import Figure

from macor_hil.arrays import Array
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
    GRADED,
    Learning,
    graded_memory,
    learn_all,
    situations_of,
)
from macor_hil.experiments.drives.training_drive import QUICK_DRIVE, Drive, Recording, Recordings
from macor_hil.experiments.experiment import Courses, Experiment
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.rows import Row, trial_rows
from macor_hil.experiments.report.statistics import estimate, mean
from macor_hil.experiments.results.store import Result, Results
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.memories.prototypes import memberships
from macor_hil.mind.planners.graded import Graded
from macor_hil.monitor.pictures import trials_figure
from macor_hil.runs.trials import Trial

ON_NODES: Final = "graded nodes"
PLACED: Final = "placed prototypes"

CHANGES: Final = {
    ANTICIPATIVE: "the paper's wave: the best outcome that ever occurred",
    EXPECTED: "outcomes weighed by their counts, pooled over the commands that led here",
    ON_NODES: "and the robot in several of Fuzzy ART's nodes at once, in counts and decisions",
    PLACED: "and prototypes instead, placed by k-means in the 400 frames of the tuning drive",
    GRADED: "and everything counted as its mirror image, too",
}


@dataclass(frozen=True)
class Settings(Learning):
    """The arenas of the trials."""

    drive: Drive = field(default_factory=Drive)
    """The training drive, of all systems."""
    courses: tuple[Course, ...] = (
        Course(),
        Course(anywhere=True),
        Course("corridor-mirror"),
        Course("s-curve", commands=90),  # its second curve begins after 40 of them
        Course("corridor-18"),
    )
    """Trained in the first arena; never seen the others."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """The arenas of the trials."""
        return tuple(course.arena for course in self.courses)


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Learn the systems from the drive of a seed, and drive their trials everywhere."""
    recording = recordings[seed]
    systems = learn_all(settings, recording)
    systems |= _steps_to(systems[GRADED], settings, recording)
    result: Result = {"outlines": {}, "trials": {}}
    for course in settings.courses:
        place = course.place
        with on_course(course, seed, settings.drive) as track:
            result["outlines"][place] = track.outline().model_dump(mode="json")
            result["trials"][place] = {
                name: [trial_as_json(one) for one in track.drive(systems[name], seed)]
                for name in CHANGES
            }
    return result


class _Boxes:
    """Fuzzy ART's nodes as graded situations: the distance is how far x lies outside a box."""

    def __init__(self, art: FuzzyArt) -> None:
        self._art = art

    def memberships(self, x: Array) -> Array:
        """Memberships of the nodes, in use or not, shape (n,)."""
        distances = np.full(self._art.nodes, np.inf)
        distances[: self._art.size] = self._art.distances(x)
        return memberships(distances)


def _steps_to(graded: System, settings: Settings, recording: Recording) -> dict[str, System]:
    """Return the steps from `expected` to `graded`, one change at a time."""
    art = graded.brain.clusterer
    assert isinstance(art, FuzzyArt)
    changed = {ON_NODES: _Boxes(art), PLACED: situations_of(recording)}
    memories = {
        name: graded_memory(settings, recording, situations, both_sides=False)
        for name, situations in changed.items()
    }
    brain = replace(graded.brain, memories=memories)
    brain.relive(recording.seen(), situations=False)
    return {name: System(brain, Graded(memory=name)) for name in changed}


def _trials(results: Results, place: str, name: str) -> list[list[Trial]]:
    """Trials without their paths, one list a seed."""
    return [
        [trial_from_json(one, way=False) for one in result["trials"][place][name]]
        for result in results.values()
    ]


def draw(settings: Settings, results: Results) -> dict[str, Figure]:
    """Draw the graded planner's first trial of the first seed in every arena."""
    result = next(iter(results.values()))
    shown = {
        course.place: (
            Outline.model_validate(result["outlines"][course.place]),
            trial_from_json(result["trials"][course.place][GRADED][0]),
        )
        for course in settings.courses
    }
    return {"trajectories": trials_figure(shown)}


def tell(settings: Settings, results: Results) -> list[Element]:
    """Report the ablation, and the result of every seed."""
    places = [course.place for course in settings.courses]
    changes = "; ".join(f"{name}: {what}" for name, what in CHANGES.items())
    return [
        Text(
            f"{len(results)} training seeds, each another robot, trained in the corridor alone;"
            f" {settings.courses[0].trials} trials of every system in every arena, of at most as"
            f" many commands as beside its name. {changes}."
        ),
        Table(
            "Length of trials, mean over seeds (95 % bootstrap interval), and trials that collided",
            ("arena, most commands", *CHANGES),
            tuple(_row(results, course) for course in settings.courses),
        ),
        Text(_verdict(settings, results)),
        Picture("trajectories", _caption(results, places)),
        Table(
            f"Mean length of the trials of {GRADED}, every seed",
            ("seed", *places),
            tuple(
                (str(seed), *(f"{_lengths(results, place, GRADED)[k]:.1f}" for place in places))
                for k, seed in enumerate(results)
            ),
        ),
    ]


def _caption(results: Results, places: Sequence[str]) -> str:
    seed, result = next(iter(results.items()))
    first = {place: trial_from_json(result["trials"][place][GRADED][0]) for place in places}
    hit = [place for place, one in first.items() if one.collided]
    return (
        f"{GRADED}, trained in the corridor alone: the first trial of seed {seed} in each arena."
        f" Collisions: {', '.join(hit) or 'none'}."
    )


def _lengths(results: Results, place: str, name: str) -> list[float]:
    return [float(np.mean([t.length for t in ts])) for ts in _trials(results, place, name)]


def _collided(results: Results, place: str, name: str) -> float:
    return float(np.mean([t.collided for ts in _trials(results, place, name) for t in ts]))


def _row(results: Results, course: Course) -> tuple[str, ...]:
    place = course.place
    cells = (
        f"{estimate(_lengths(results, place, name), mean)};"
        f" {100 * _collided(results, place, name):.1f} %"
        for name in CHANGES
    )
    return (f"{place}, {course.commands}", *cells)


def _verdict(settings: Settings, results: Results) -> str:
    def part(course: Course) -> float:
        return float(np.mean(_lengths(results, course.place, GRADED))) / course.commands

    def driven(course: Course) -> str:
        place = course.place
        return (
            f"{np.mean(_lengths(results, place, GRADED)):.2f} of {course.commands} commands"
            f" ({100 * _collided(results, place, GRADED):.1f} % collisions)"
        )

    home = settings.courses[0]
    said = f"{GRADED} drives {driven(home)} where it was trained"
    away = [course for course in settings.courses if course.arena != home.arena]
    if away:
        least = min(away, key=part)
        said += f", and in arenas never seen at least {driven(least)}, in {least.arena}"
    return f"{said}."


def rows(_: Settings, results: Results) -> Iterator[Row]:
    """Yield one row for each trial."""
    for seed, result in results.items():
        for place, by_system in result["trials"].items():
            for system, trials in by_system.items():
                where: Row = {"place": place, "seed": seed, "system": system}
                yield from trial_rows(map(trial_from_json, trials), where)


QUICK: Final = Settings(
    drive=QUICK_DRIVE,
    courses=(
        Course(trials=2),
        Course(trials=2, anywhere=True),
        Course("corridor-mirror", trials=2),
    ),
)

BEYOND = Experiment(
    "beyond",
    "Beyond the paper: what each change gives, and elsewhere",
    Settings(),
    trial,
    draw,
    tell,
    quick=QUICK,
    rows=rows,
    courses=Courses(
        lambda settings, _: {course.place: course for course in settings.courses},
        lambda _, result: result["trials"],
    ),
)
