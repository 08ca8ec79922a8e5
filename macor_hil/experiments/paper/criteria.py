"""The criteria of table 1, and the table's form: the printed numbers beside those of trials."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from macor_hil.experiments.drives.course import trial_from_json
from macor_hil.experiments.drives.systems import ANTICIPATIVE, REACTIVE, SYSTEMS, Q
from macor_hil.experiments.report.elements import Table
from macor_hil.experiments.report.rows import Row, trial_rows
from macor_hil.experiments.report.statistics import Order
from macor_hil.experiments.results.store import Results
from macor_hil.runs.trials import Trial

TRIALS: Final = 10
"""Trials of each system in the paper."""


@dataclass(frozen=True, slots=True)
class Printed:
    """A row of table 1: mean and standard deviation over the paper's ten trials.

    Attributes:
        r, r_std: reinforcement of a trial.
        length, length_std: commands of a trial.
        step: reinforcement of a command.
        collisions: trials that ended in one.
    """

    r: float
    r_std: float
    length: float
    length_std: float
    step: float
    collisions: int

    def cells(self) -> tuple[str, ...]:
        """Return the row as it is printed."""
        numbers = (self.r, self.r_std, self.length, self.length_std)
        collided = f"{100 * self.collisions / TRIALS:.0f} %"
        return (*(f"{value:.1f}" for value in numbers), f"{self.step:.2f}", collided)


PAPER: Final = {
    REACTIVE: Printed(2.8, 0.1, 7.2, 0.4, 0.61, 10),
    ANTICIPATIVE: Printed(15.6, 8.6, 29.2, 14.2, 0.55, 4),
    Q: Printed(4.2, 2.4, 11.7, 4.2, 0.57, 10),
}
"""Table 1 as printed."""


def systems_of(results: Results) -> tuple[str, ...]:
    """List the systems that have driven: those of the table first, then other planners."""
    if not results:
        return SYSTEMS
    driven = next(iter(results.values()))["trials"]
    own = (name for name in SYSTEMS if name in driven)
    return (*own, *(name for name in driven if name not in SYSTEMS))


def trials_of(results: Results, system: str) -> list[list[Trial]]:
    """Trials of a system, one list a seed."""
    return [[trial_from_json(t) for t in result["trials"][system]] for result in results.values()]


def rows(_: object, results: Results) -> Iterator[Row]:
    """Yield one row for each trial."""
    for seed, result in results.items():
        for system, trials in result["trials"].items():
            where: Row = {"seed": seed, "system": system}
            yield from trial_rows(map(trial_from_json, trials), where)


def reinforcement_a_step(trials: Sequence[Trial]) -> float:
    """Mean reinforcement of a command, "not considering the step that resulted in a collision"."""
    steps = [r for one in trials for r in one.reinforcement[: one.length - one.collided]]
    return float(np.mean(steps)) if steps else 0.0


def per_seed(results: Results, system: str) -> dict[str, list[float]]:
    """Return the table's criteria, one value a seed: the mean over its trials."""
    seeds = trials_of(results, system)
    return {
        "r": [float(np.mean([t.total for t in trials])) for trials in seeds],
        "length": [float(np.mean([t.length for t in trials])) for trials in seeds],
        "step": [reinforcement_a_step(trials) for trials in seeds],
        "collisions": [float(np.mean([t.collided for t in trials])) for trials in seeds],
    }


def paper_table(title: str, results: Results) -> Table:
    """Return all trials of all seeds in the paper's form, its own rows beside them."""
    rows = []
    for system in systems_of(results):
        trials = [one for seed in trials_of(results, system) for one in seed]
        rows.append((f"{system}, here", *_cells(trials)))
        if system in PAPER:
            rows.append((f"{system}, paper", *PAPER[system].cells()))
    head = ("system", "r per trial: mean", "std", "length: mean", "std", "r per step", "collided")
    return Table(title, head, tuple(rows))


def _cells(trials: Sequence[Trial]) -> tuple[str, ...]:
    totals, lengths = [t.total for t in trials], [float(t.length) for t in trials]
    return (
        *(f"{f(v):.1f}" for v in (totals, lengths) for f in (np.mean, np.std)),
        f"{reinforcement_a_step(trials):.2f}",
        f"{100 * np.mean([t.collided for t in trials]):.0f} %",
    )


def order_table(title: str, tests: Callable[[str], Mapping[str, Order]]) -> Table:
    """Return tests of orderings by reinforcement and by length.

    Args:
        title: what is tested.
        tests: of a criterion of `per_seed`, by what they claim.
    """
    rows = []
    for criterion, label in (("r", "r per trial"), ("length", "length")):
        for name, test in tests(criterion).items():
            said = "yes" if test.holds else "not shown"
            counts = f"{test.wins} / {test.ties} / {test.seeds - test.wins - test.ties}"
            rows.append((name, label, str(test.difference), counts, f"{test.p:.4f}", said))
    head = ("ordering", "criterion", "mean difference", "better / equal / worse", "p", "holds")
    return Table(f"{title}, paired by seed (sign flips, one-sided)", head, tuple(rows))
