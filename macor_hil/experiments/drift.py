"""Drift: maps learned with and without the robot's drift, driven on robots with other drifts.

The caption of figure 3 claims that a robot that drifts to one side navigates all the same because
the drift was learned with everything else. So: two trainings a seed, on a robot whose wheels differ
and on one whose wheels do not; both maps then drive robots without drift, with another
robot's drift, and with one that pulls to one side by a known amount.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from macor_hil.experiments.drives.course import Course, on_course, trial_as_json, trial_from_json
from macor_hil.experiments.drives.systems import ANTICIPATIVE, GRADED, Learning, learn_all
from macor_hil.experiments.drives.training_drive import QUICK_DRIVE, Drive, Recordings
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.report.drawing import draw_seeds
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.rows import Row, trial_rows
from macor_hil.experiments.report.statistics import estimate, mean, order
from macor_hil.experiments.results.store import Result, Results

SHOWN: Final = {ANTICIPATIVE: "anticipative", GRADED: "graded"}
"""Systems that are driven, each with the name of its picture."""

_OTHER: Final = 1000
"""Added to a training's seed for the robot that its map is driven on: never the same robot."""


@dataclass(frozen=True)
class Settings(Learning):
    """Drifts of training and of trials."""

    drive: Drive = field(default_factory=Drive)
    """The training drive; its drift is the first one below."""
    trained: tuple[str, ...] = ("default", "none")
    """Drifts of the robots that are trained on."""
    driven: tuple[str, ...] = ("none", "default", "scale=0.04,base=0.04", "strong")
    """Drifts of the robots that are driven."""
    course: Course = field(default_factory=Course)
    """Trials."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """The arenas of the trials."""
        return (self.course.arena,)


def drives(settings: Settings, _: Path) -> list[Drive]:
    """Return the training drives of a seed, one with each drift."""
    return [replace(settings.drive, drift=drift) for drift in settings.trained]


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Train with each drift, drive with each."""
    result: Result = {"trials": {}}
    for drift in settings.trained:
        drive = replace(settings.drive, drift=drift)
        systems = learn_all(settings, recordings.of(drive)[seed])
        driven = result["trials"][drift] = {}
        for other in settings.driven:
            robot = replace(drive, drift=other)
            with on_course(settings.course, seed + _OTHER, robot) as track:
                driven[other] = {
                    name: [trial_as_json(one) for one in track.drive(systems[name], seed)]
                    for name in SHOWN
                }
    return result


def _lengths(results: Results, trained: str, driven: str, name: str) -> list[float]:
    return [
        float(np.mean([trial_from_json(t).length for t in result["trials"][trained][driven][name]]))
        for result in results.values()
    ]


def draw(settings: Settings, results: Results) -> dict[str, Figure]:
    """Every seed on the robots that are driven, a picture for each system."""
    return {
        picture: draw_seeds(
            {
                _below(trained, driven): _lengths(results, trained, driven, name)
                for driven in settings.driven
                for trained in settings.trained
            },
            f"commands in a trial,\n{name}",
            {},
        )
        for name, picture in SHOWN.items()
    }


def _below(trained: str, driven: str) -> str:
    """Return the text below a column of the picture, in lines that leave room for neighbours."""
    return f"trained: {trained}\ndriven: {driven}".replace(",", ",\n")


def tell(settings: Settings, results: Results) -> list[Element]:
    """Lengths by drift of training and of trials."""
    head = ("driven on", *(f"{n}, trained: {t}" for n in SHOWN for t in settings.trained))
    rows = tuple(
        (
            other,
            *(
                str(estimate(_lengths(results, trained, other, name), mean))
                for name in SHOWN
                for trained in settings.trained
            ),
        )
        for other in settings.driven
    )
    return [
        Text(
            f"{len(results)} training seeds; drifts as of the emulator's --drift, drawn for each"
            " robot; a map is never driven on the robot that it was trained on."
        ),
        Table("Length of trials, mean over seeds (95 % bootstrap interval)", head, rows),
        Text(_verdict(settings, results)),
        *(Picture(picture, _caption(settings, results, name)) for name, picture in SHOWN.items()),
    ]


def _caption(settings: Settings, results: Results, name: str) -> str:
    pairs = [(d, t) for d in settings.driven for t in settings.trained]
    means = [float(np.mean(_lengths(results, t, d, name))) for d, t in pairs]
    return (
        f"Every training seed of {name}, by the drift that was trained with and the one that is"
        f" driven with. The means lie between {min(means):.1f} and {max(means):.1f} commands."
    )


def _verdict(settings: Settings, results: Results) -> str:
    with_drift, without = settings.trained
    said = []
    for name in SHOWN:
        tests = {
            other: order(
                _lengths(results, with_drift, other, name), _lengths(results, without, other, name)
            )
            for other in settings.driven
        }
        better = [other for other, test in tests.items() if test.holds]
        said.append(
            f"{name}: training with drift gives longer trials on robots with the drift"
            f" {' and '.join(better)}"
            if better
            else f"{name}: these seeds show no gain from training with drift"
        )
    return "; ".join(said) + "."


def rows(_: Settings, results: Results) -> Iterator[Row]:
    """Yield one row for each trial."""
    for seed, result in results.items():
        for trained, by_drift in result["trials"].items():
            for driven, by_system in by_drift.items():
                for system, trials in by_system.items():
                    where: Row = {"trained": trained, "driven": driven, "seed": seed}
                    yield from trial_rows(map(trial_from_json, trials), {**where, "system": system})


QUICK: Final = Settings(drive=QUICK_DRIVE, driven=("none", "strong"), course=Course(trials=2))

DRIFT = Experiment(
    "drift",
    "Drift: learned with everything else?",
    Settings(),
    trial,
    draw,
    tell,
    most_seeds=8,
    quick=QUICK,
    rows=rows,
    drives=drives,
)
