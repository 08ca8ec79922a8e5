"""Benchmarks and the figures that they give."""

from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import NamedTuple, Protocol

import numpy as np


class Figure(NamedTuple):
    """A row of the table: what was measured, in this run against what, and the ratio."""

    name: str
    value: str
    against: str
    ratio: str


class Bench(Protocol):
    """Something that is measured several times, in turn with others."""

    def round(self) -> dict[str, float]:
        """Measure once: a number for each name."""
        ...

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """Rows of the table, from the median of each name over all rounds."""
        ...


def percentile(values: list[float], share: float = 99.0) -> float:
    """Return a percentile of what was measured."""
    return float(np.percentile(values, share))


def medians(benches: Sequence[Bench], rounds: Iterable[object]) -> list[dict[str, float]]:
    """Measure all benches in turn, once in each round: for each bench the median of each name."""
    found: list[list[dict[str, float]]] = [[] for _ in benches]
    for _ in rounds:
        for bench, each in zip(benches, found, strict=True):
            each.append(bench.round())
    return [{name: median(one[name] for one in each) for name in each[0]} for each in found]
