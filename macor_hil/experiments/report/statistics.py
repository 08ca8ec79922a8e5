"""Statistics over training seeds: interquartile means, bootstrap intervals, paired tests.

A training seed is one independent sample: its trials share a map, and are averaged first.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from macor_hil.arrays import Array

LEVEL: Final = 0.95
_RESAMPLES: Final = 10_000
_EXACT: Final = 14
"""Pairs up to which the sign-flip test goes through all 2^n sign patterns."""


def interquartile_mean(values: Array | Sequence[float], axis: int = -1) -> Array:
    """Mean without the lowest and the highest quarter (each rounded down to whole values)."""
    ordered = np.sort(np.asarray(values, dtype=float), axis=axis)
    cut = ordered.shape[axis] // 4
    middle = np.take(ordered, range(cut, ordered.shape[axis] - cut), axis=axis)
    mean: Array = middle.mean(axis=axis)
    return mean


def mean(values: Array | Sequence[float], axis: int = -1) -> Array:
    """Return the plain mean."""
    plain: Array = np.mean(np.asarray(values, dtype=float), axis=axis)
    return plain


Statistic = Callable[..., Array]


@dataclass(frozen=True, slots=True)
class Estimate:
    """A statistic with its 95 % bootstrap interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.2f} ({self.low:.2f} to {self.high:.2f})"


def estimate(values: Sequence[float], statistic: Statistic = interquartile_mean) -> Estimate:
    """Return a statistic of independent samples and its percentile bootstrap interval.

    Samples are drawn with replacement 10,000 times, always with the same random numbers.
    """
    samples = np.asarray(values, dtype=float)
    rng = np.random.default_rng(0)
    drawn = samples[rng.integers(len(samples), size=(_RESAMPLES, len(samples)))]
    tail = (1 - LEVEL) / 2
    low, high = np.quantile(statistic(drawn, axis=1), [tail, 1 - tail])
    return Estimate(float(statistic(samples)), float(low), float(high))


def sign_flip_p(differences: Sequence[float]) -> float:
    """One-sided p of "the mean difference is not above 0", by flipping the signs of pairs.

    If neither system were better, every difference could as well have had the other sign. All
    sign patterns are gone through for up to 14 pairs, 10,000 random ones (and the observed one)
    beyond.
    """
    d = np.asarray(differences, dtype=float)
    if len(d) <= _EXACT:
        signs = np.array(list(product((1.0, -1.0), repeat=len(d))))
    else:
        rng = np.random.default_rng(0)
        drawn = rng.choice((1.0, -1.0), size=(_RESAMPLES, len(d)))
        signs = np.vstack([np.ones(len(d)), drawn])
    sums = signs @ d
    # what differs from the observed sum by rounding only counts as equal to it
    return float(np.mean(sums >= d.sum() - 1e-9 * np.abs(d).sum()))


def too_few(seeds: int, tests: int = 1) -> str:
    """Return a sentence if so few seeds cannot make a sign-flip test hold; else nothing.

    Args:
        seeds: pairs of each test.
        tests: that are to hold together by Holm's correction.
    """
    if 0.5**seeds < (1 - LEVEL) / tests:
        return ""
    together = "" if tests == 1 else f" in {tests} tests at the same time"
    return f" With {seeds} seeds p < 0.05{together} cannot be reached whatever happens."


def holm(p: Sequence[float], level: float = 1 - LEVEL) -> list[bool]:
    """Return which of several tests hold together, by Holm's step-down correction.

    With it the probability that any of them is wrong stays below the level. Source: S. Holm, "A
    simple sequentially rejective multiple test procedure", 1979.
    """
    held = [False] * len(p)
    for left, place in zip(range(len(p), 0, -1), np.argsort(p, kind="stable"), strict=True):
        if p[place] > level / left:
            break
        held[place] = True
    return held


@dataclass(frozen=True, slots=True)
class Order:
    """A test of one system against another, paired by training seed.

    Attributes:
        difference: mean difference with its interval.
        p: one-sided, of the sign-flip test.
        wins, ties: seeds on which the first is better, and on which they are equal.
        seeds: pairs in all.
    """

    difference: Estimate
    p: float
    wins: int
    ties: int
    seeds: int

    @property
    def holds(self) -> bool:
        """True if the interval lies above 0 and p below 5 %."""
        return self.difference.low > 0.0 and self.p < 1 - LEVEL


def order(better: Sequence[float], worse: Sequence[float]) -> Order:
    """Test that `better` is above `worse`, value by value of the same seeds."""
    d = np.asarray(better, dtype=float) - np.asarray(worse, dtype=float)
    return Order(
        estimate(d.tolist(), mean),
        sign_flip_p(d.tolist()),
        int((d > 0).sum()),
        int((d == 0).sum()),
        len(d),
    )
