"""Changing goals, the paper's outlook (section 4), which was never published.

After training the reinforcement changes: turns earn as much as straight on did, and straight on
next to nothing, so that the best way is a slalom. (A goal that the old way serves as well, such as
"no turns to the left" where the corridor turns left, shows nothing: who learns it meets the wall.)
What the world does stays as it is, so that situations, competences and counts are kept;
evaluations are learned anew, each with its learning rate 1/z counted from the change. The
experience after the change is the training drive once more, under the new reinforcement. How many
commands of it does each system need until it earns as much as one that was trained for the new goal
from the beginning?
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from khepera_protocol import palette
from matplotlib.figure import Figure

from macor_hil.experiments.drives.course import Course, System, Track, on_course
from macor_hil.experiments.drives.relearning import relearned
from macor_hil.experiments.drives.systems import (
    ANTICIPATIVE,
    EXPECTED,
    GRADED,
    REACTIVE,
    Learning,
    Q,
    learn_all,
)
from macor_hil.experiments.drives.training_drive import QUICK_DRIVE, Drive, Recording, Recordings
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.report.drawing import begin_at_zero, draw_interval
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.rows import Row
from macor_hil.experiments.report.statistics import estimate, mean
from macor_hil.experiments.results.store import Result, Results
from macor_hil.mind.reinforcement import Reinforcement

SHOWN: Final = (REACTIVE, ANTICIPATIVE, Q, EXPECTED, GRADED)
_WELL: Final = 0.9
"""Part of what the system trained for the new goal earns that counts as behaving well again."""


@dataclass(frozen=True)
class Settings(Learning):
    """The change, and when it is looked at."""

    drive: Drive = field(default_factory=Drive)
    """The training drive."""
    goal: Reinforcement = field(default_factory=lambda: Reinforcement(straight=0.1, turn=0.62))
    """The reinforcement of commands after the change."""
    looks: tuple[int, ...] = (0, 100, 300, 1_000, 3_000, 10_000)
    """Frames after the change at which trials are driven."""
    course: Course = field(default_factory=lambda: Course(trials=5))
    """Trials."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """The arenas of the trials."""
        return (self.course.arena,)


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Train for the old goal and for the new one, change the goal, look again and again."""
    recording = recordings[seed]
    old = learn_all(settings, recording)
    fresh = learn_all(replace(settings, reinforcement=settings.goal), recording)
    with on_course(settings.course, seed, settings.drive) as track:
        return {
            "trained for it": {n: _earned(settings, track, fresh[n], seed) for n in SHOWN},
            "after": {
                str(frames): {
                    name: _earned(settings, track, _changed(settings, one, recording, frames), seed)
                    for name, one in old.items()
                    if name in SHOWN
                }
                for frames in settings.looks
            },
        }


def _earned(settings: Settings, track: Track, system: System, seed: int) -> float:
    """Mean reinforcement of a trial under the new goal."""
    rewarded = System(replace(system.brain, reinforcement=settings.goal), system.planner)
    driven = track.drive(rewarded, seed)
    return round(float(np.mean([one.total for one in driven])), 4)


def _changed(settings: Settings, system: System, recording: Recording, frames: int) -> System:
    """Return a system some frames after the change."""
    since = recording.seen(frames)
    return relearned(settings, system, recording, since, settings.goal, before=1.0)


def commands_needed(settings: Settings, result: Result, name: str) -> int | None:
    """Frames until a system earned 90 % of what one trained for the goal earns; None: never."""
    enough = _WELL * result["trained for it"][name]
    return next((n for n in settings.looks if result["after"][str(n)][name] >= enough), None)


def draw(settings: Settings, results: Results) -> dict[str, Figure]:
    """Reinforcement after the change, and at the right that of systems trained for the goal."""
    figure = Figure(figsize=(8.0, 5.4), layout="constrained")
    axes = figure.subplots()
    fresh = len(settings.looks) + 0.5
    places = [*range(len(settings.looks)), fresh]
    for number, name in enumerate(SHOWN):
        *after, trained = [estimate(earned, mean) for earned in _looks(settings, results, name)]
        draw_interval(axes, places[:-1], after, name, number)
        bars = [[trained.value - trained.low], [trained.high - trained.value]]
        aside = 0.12 * (number - 2)
        colour, marker = palette.SERIES[number], palette.MARKERS[number]
        axes.errorbar(
            fresh + aside, trained.value, np.abs(bars), fmt=marker, color=colour, capsize=4
        )
    axes.set_xticks(places, [*(f"{n:,}" for n in settings.looks), "trained\nfor it"])
    axes.set_xlabel("frames since the goal changed")
    begin_at_zero(axes)
    axes.set_ylabel("reinforcement in a trial, new goal")
    axes.grid()
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return {"goals": figure}


def _looks(settings: Settings, results: Results, name: str) -> list[list[float]]:
    """Reinforcement of every seed, at each look and last when trained for the new goal."""
    after = [
        [result["after"][str(frames)][name] for result in results.values()]
        for frames in settings.looks
    ]
    return [*after, [result["trained for it"][name] for result in results.values()]]


def tell(settings: Settings, results: Results) -> list[Element]:
    """Report the reinforcement of each system, and how soon it earns it."""
    rows = []
    for name in SHOWN:
        looks = _looks(settings, results, name)
        rows.append((name, *(str(estimate(earned, mean)) for earned in looks)))
    head = ("system", *(f"after {n:,}" for n in settings.looks), "trained for it")
    return [
        Text(
            f"{len(results)} training seeds. After the change straight on earns"
            f" {settings.goal.straight:g} (before: {settings.reinforcement.straight:g}), a turn"
            f" {settings.goal.turn:g} ({settings.reinforcement.turn:g}) and a collision"
            f" {settings.goal.collision:g} ({settings.reinforcement.collision:g})."
            f" {settings.course.trials} trials at each look."
        ),
        Table("Reinforcement per trial under the new goal, mean over seeds", head, tuple(rows)),
        _needed(settings, results),
        Picture("goals", _caption(results)),
    ]


def _caption(results: Results) -> str:
    fresh = {n: float(np.mean([r["trained for it"][n] for r in results.values()])) for n in SHOWN}
    best = max(fresh, key=fresh.__getitem__)
    return (
        "Reinforcement in a trial after the change, and at the right that of systems trained for"
        " the new goal alone; bands and bars: 95 % interval over seeds. A curve that reaches its"
        f" own mark at the right has relearned; {best} earns most when trained for the goal."
    )


def _needed(settings: Settings, results: Results) -> Table:
    rows = []
    for name in SHOWN:
        needed = [commands_needed(settings, result, name) for result in results.values()]
        done = sorted(n for n in needed if n is not None)
        median = f"{done[len(done) // 2]:,}" if len(done) * 2 > len(needed) else "more"
        rows.append((name, median, f"{len(done)} of {len(needed)}"))
    return Table(
        "Frames until 90 % of what the same system earns when trained for the goal",
        ("system", "median over seeds", "seeds that got there"),
        tuple(rows),
    )


def rows(settings: Settings, results: Results) -> Iterator[Row]:
    """Yield one row for each look: the mean reinforcement of its trials."""
    for seed, result in results.items():
        looks = [(str(frames), result["after"][str(frames)]) for frames in settings.looks]
        for frames, earned in (*looks, ("trained for it", result["trained for it"])):
            for system, r in earned.items():
                yield {"frames": frames, "seed": seed, "system": system, "reinforcement": r}


QUICK: Final = Settings(drive=QUICK_DRIVE, looks=(0, 100, 1_000), course=Course(trials=2))

GOALS = Experiment(
    "goals",
    "Changing goals",
    Settings(),
    trial,
    draw,
    tell,
    most_seeds=10,
    quick=QUICK,
    rows=rows,
)
