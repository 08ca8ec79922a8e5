"""Places of the paper's numbers among trainings: it prints ten trials of a single one."""

from collections.abc import Sequence
from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from macor_hil.experiments.paper.criteria import PAPER, TRIALS, Printed, per_seed, trials_of
from macor_hil.experiments.report.elements import Table
from macor_hil.experiments.report.statistics import Estimate, estimate, mean
from macor_hil.experiments.results.store import Results
from macor_hil.runs.trials import Trial

DEFINITION: Final = (
    "The percentile of a printed mean is the share of the trainings here whose mean lies below it;"
    " those that are equal to it, as it is printed, count half. Ten trials of a training look like"
    " the paper's row when as many of them collide as it prints, and when their mean length lies"
    " within two standard errors of the printed mean, which are 2 std / sqrt(10) with the printed"
    " standard deviation of ten trials. For the probability of that, ten trials of each training"
    " are drawn with replacement 2,000 times; shown is the mean over trainings with its 95 %"
    " bootstrap interval."
)

_RESAMPLES: Final = 2_000
_ERRORS: Final = 2.0
"""Standard errors within which a mean length looks like the printed one."""


def percentile(value: float, among: Sequence[float]) -> float:
    """Return the share of values below one, in percent; those that equal it count half.

    Args:
        value: printed with one decimal.
        among: values, which are rounded as it is.

    Raises:
        ValueError: there are no values.
    """
    if not among:
        raise ValueError("there are no values to compare with")
    # in tenths, as whole numbers: decimal fractions are not equal to one another
    tenths = np.round(10 * np.asarray(among, dtype=float))
    asked = round(10 * value)
    return float(100 * np.mean((tenths < asked) + 0.5 * (tenths == asked)))


class Likeness(NamedTuple):
    """Probabilities that ten trials of one training look like a printed row.

    Attributes:
        collisions: as many collide.
        length: their mean length is like the printed one.
        both: both at the same time.
    """

    collisions: Estimate
    length: Estimate
    both: Estimate


def likeness(printed: Printed, trainings: Sequence[Sequence[Trial]]) -> Likeness:
    """Return how probable it is that ten trials of one training look like a printed row.

    Args:
        printed: the row.
        trainings: trials of each.
    """
    chances = np.array([_chances(printed, trials) for trials in trainings])
    return Likeness(*(estimate(column.tolist(), mean) for column in chances.T))


def _chances(printed: Printed, trials: Sequence[Trial]) -> tuple[float, float, float]:
    """Return the probabilities of one training: as many collisions, as long, both."""
    rng = np.random.default_rng(0)
    drawn = rng.integers(len(trials), size=(_RESAMPLES, TRIALS))
    lengths = np.array([one.length for one in trials], dtype=float)[drawn].mean(axis=1)
    collisions = np.array([one.collided for one in trials])[drawn].sum(axis=1)
    as_many = collisions == printed.collisions
    as_long = np.abs(lengths - printed.length) <= _ERRORS * printed.length_std / sqrt(TRIALS)
    return float(as_many.mean()), float(as_long.mean()), float((as_many & as_long).mean())


def placing_table(groups: Sequence[tuple[str, Results]]) -> Table:
    """Return where every printed mean lies among trainings, and how probable its row is.

    Args:
        groups: trials of the paper's systems, under what each group is called.
    """
    rows = []
    for label, results in groups:
        for system, printed in PAPER.items():
            values = per_seed(results, system)
            like = likeness(printed, trials_of(results, system))
            rows.append(
                (
                    f"{system}, {label}",
                    *_placed(printed.r, values["r"]),
                    *_placed(printed.length, values["length"]),
                    *map(_share, like),
                )
            )
    head = (
        *("system", "r per trial, paper", "percentile here", "length, paper", "percentile here"),
        *("P: as many collide", "P: as long", "P: looks like the row"),
    )
    return Table("Where the paper's numbers lie among trainings", head, tuple(rows))


def _placed(value: float, among: Sequence[float]) -> tuple[str, str]:
    return f"{value:.1f}", f"{percentile(value, among):.0f}"


def _share(chance: Estimate) -> str:
    return f"{chance.value:.3f} ({chance.low:.3f} to {chance.high:.3f})"
