"""Results of the map: criteria by point, system and seed, rows of a CSV file, tests."""

from collections.abc import Iterator
from dataclasses import asdict, fields
from typing import Final, NamedTuple

import numpy as np

from macor_hil.experiments.paper.sensitivity.driving import SYSTEMS
from macor_hil.experiments.paper.sensitivity.points import Point, Settings
from macor_hil.experiments.report.rows import Row
from macor_hil.experiments.report.statistics import Estimate, Order, estimate, mean, order
from macor_hil.experiments.results.store import Result, Results


class Outcome(NamedTuple):
    """Outcome of a system at a point, one value a seed: the mean over its trials."""

    length: list[float]
    collided: list[float]
    r: list[float]

    def mean_length(self) -> Estimate:
        """Return the mean over seeds with its interval."""
        return estimate(self.length, mean)


Map = dict[Point, dict[str, Outcome]]
"""Outcomes by points and systems."""


def outcomes(results: Results) -> Map:
    """Return what came out at every point."""
    by_seed = [_by_point(result) for result in results.values()]
    points = by_seed[0] if by_seed else {}
    found: Map = {}
    for point in points:
        found[point] = {}
        for name in SYSTEMS:
            means = np.array([np.mean(of[point][name], axis=0) for of in by_seed], dtype=float)
            length, collided, r = means.T.tolist()
            found[point][name] = Outcome(length, collided, r)
    return found


def _by_point(result: Result) -> dict[Point, dict[str, list[list[float]]]]:
    return {Point(**one["point"]): one["trials"] for one in result["driven"]}


def orders(found: Map, better: str, worse: str, criterion: str) -> dict[Point, Order]:
    """Return the tests of an ordering at every point, by a criterion of `Outcome`."""
    return {
        point: order(getattr(systems[better], criterion), getattr(systems[worse], criterion))
        for point, systems in found.items()
    }


def rows(_: Settings, results: Results) -> Iterator[Row]:
    """Return one row for each trial."""
    for seed, result in results.items():
        for point, systems in _by_point(result).items():
            for name, trials in systems.items():
                for number, (length, collided, r) in enumerate(trials):
                    yield {
                        **asdict(point),
                        "seed": seed,
                        "system": name,
                        "trial": number,
                        "length": length,
                        "collided": int(collided),
                        "reinforcement": r,
                    }


LABELS: Final = {
    "vigilance": "vigilance",
    "nodes": "nodes",
    "w_max": "greatest competence",
    "mu": "mu",
    "gamma": "gamma",
    "turn": "r of a turn",
    "collision": "r of a collision",
    "commands": "commands of training",
    "width": "width of the corridor, m",
    "distance": "start to end wall, m",
}
"""Fields of points in tables and pictures."""


def shown(value: float) -> str:
    """Return a value as it stands in tables and pictures."""
    return f"{value:,}" if isinstance(value, int) else f"{value:g}"


def named(point: Point, base: Point) -> str:
    """Return a point by what differs from the base."""
    values = ((f.name, getattr(point, f.name)) for f in fields(Point))
    changed = (
        f"{LABELS[name]} {shown(value)}" for name, value in values if value != getattr(base, name)
    )
    return " and ".join(changed) or "settings of table 1"
