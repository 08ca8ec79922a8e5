"""All that moves in a world, by squares of floor, so that not all is asked for what is near."""

from collections.abc import Iterable, Sequence
from math import floor

from khepera_emulator.world.floor_plan import NEAR
from khepera_emulator.world.solids import Footprint

_SQUARE = 0.1
"""Side in metres of the squares."""

_SLACK = 0.05
"""Metres that something may move before the squares are sorted anew, twice over."""


class Neighbours:
    """The movers of a world, sorted by the squares from which they may be near.

    Args:
        movers: what moves; the sequence may grow and shrink, and its members move.

    Attributes:
        period: of the world; set from outside, so that positions are compared once in each.
    """

    def __init__(self, movers: Sequence[Footprint]) -> None:
        self.period = 0
        self._movers = movers
        self._squares: dict[tuple[int, int], list[Footprint]] = {}
        self._places: list[tuple[Footprint, float, float]] = []
        self._compared = -1

    def around(self, x: float, y: float) -> Iterable[Footprint]:
        """Return all movers within `NEAR` of a point, and a few more, in their order."""
        if self._compared != self.period or len(self._places) != len(self._movers):
            self._compared = self.period
            if self._have_moved():
                self._sort()
        return self._squares.get((floor(x / _SQUARE), floor(y / _SQUARE)), ())

    def forget(self) -> None:
        """Begin anew: something was put elsewhere."""
        self._places.clear()
        self._squares.clear()
        self._compared = -1

    def _have_moved(self) -> bool:
        if len(self._places) != len(self._movers):
            return True
        return any(
            not (abs(mover.x - x) < _SLACK and abs(mover.y - y) < _SLACK)
            for mover, x, y in self._places
        )

    def _sort(self) -> None:
        self._squares.clear()
        self._places = [(mover, mover.x, mover.y) for mover in self._movers]
        for mover in self._movers:
            corners = [(abs(x - mover.x), abs(y - mover.y)) for x, y in mover.corners()]
            size = max(max(corner) for corner in corners) * 1.5  # it may turn
            reach = size + NEAR + 2 * _SLACK
            columns = range(
                floor((mover.x - reach) / _SQUARE), floor((mover.x + reach) / _SQUARE) + 1
            )
            rows = range(floor((mover.y - reach) / _SQUARE), floor((mover.y + reach) / _SQUARE) + 1)
            for column in columns:
                for row in rows:
                    self._squares.setdefault((column, row), []).append(mover)
