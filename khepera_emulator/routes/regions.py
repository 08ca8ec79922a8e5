"""Regions of an arena to be reached: near a solid or a lamp, and in its sight."""

from collections.abc import Iterator, Sequence
from math import hypot
from typing import Final

import numpy as np
from khepera_protocol.zenoh.payloads import Outline

from khepera_emulator.routes.feelers import Flags, Poses
from khepera_emulator.world.rays import Array

Point = tuple[float, float]

_STEP: Final = 0.01
"""Metres between places of a solid's edge that are looked at."""

_JOINT: Final = 0.02
"""Metres from a solid of another colour within which a point may belong to where both meet."""

_OPEN: Final = 0.002
"""Metres before its end at which a line of sight ends: what it leads to hides nothing."""


class Region:
    """All places from which one of some points is near and in sight.

    Args:
        points: of what is to be reached, in metres.
        outline: the arena, whose solids hide what is behind them.
        reach: metres.
    """

    def __init__(self, points: Sequence[Point], outline: Outline, reach: float) -> None:
        self._points = np.array(points, dtype=float).reshape(-1, 2)
        edges = [
            (a, b)
            for solid in outline.solids
            for a, b in zip(solid.corners, [*solid.corners[1:], solid.corners[0]], strict=True)
        ]
        self._begins, self._ends = np.array(edges, dtype=float).reshape(-1, 2, 2).swapaxes(0, 1)
        self._reach = reach

    def holds(self, poses: Poses) -> Flags:
        """Return which of N poses are in it, shape (N,)."""
        held = np.zeros(len(poses.x), dtype=bool)
        away = np.hypot(
            poses.x[:, None] - self._points[:, 0], poses.y[:, None] - self._points[:, 1]
        )
        pose, point = np.nonzero(away <= self._reach)
        place = np.stack([poses.x[pose], poses.y[pose]], axis=1)
        sight = self._points[point] - place
        length = np.maximum(np.hypot(*sight.T), _OPEN)
        sight *= ((length - _OPEN) / length)[:, None]
        held[pose[~self._hidden(place, sight)]] = True
        return held

    def _hidden(self, place: Array, sight: Array) -> Flags:
        """Return which lines, from places and so long, cross an edge."""
        edge = self._ends - self._begins
        apart = self._begins - place[:, None]
        across = _cross(sight[:, None], edge)
        across = np.where(across == 0.0, np.inf, across)
        along = _cross(apart, edge) / across
        where = _cross(apart, sight[:, None]) / across
        crossed = (along > 0) & (along < 1) & (where >= 0) & (where <= 1) & np.isfinite(across)
        return np.asarray(crossed.any(axis=1), np.bool_)


def edge_points(outline: Outline, colour: Sequence[float]) -> list[Point]:
    """Return points along the edges of all solids of a colour, a centimetre from each other.

    Those close to a solid of another colour are left out: where walls meet, an end of one may stand
    out of the other by its thickness.
    """
    own: list[Point] = []
    other: list[Point] = []
    for solid in outline.solids:
        ours = bool(np.allclose(solid.colour, colour, atol=1e-3))
        (own if ours else other).extend(_along_edges(solid.corners))
    if not other:
        return own
    others = np.array(other)
    return [p for p in own if np.hypot(*(others - p).T).min() > _JOINT]


def _along_edges(corners: Sequence[Point]) -> Iterator[Point]:
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        count = max(1, round(hypot(b[0] - a[0], b[1] - a[1]) / _STEP))
        for k in range(count):
            share = k / count
            yield a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])


def _cross(a: Array, b: Array) -> Array:
    crossed: Array = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return crossed
