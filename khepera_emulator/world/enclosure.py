"""The floor that an arena's walls close off: where robots are, and where they are not put.

An arena is a list of walls, and nothing says which side of them is the inside. It is taken to be
all that a body cannot get to from far away: the floor is cut into squares, and what can be reached
from a corner beyond everything is outside. Where the arena's own start is outside, as in an
arena of a few posts, there is no inside, and every place is as good.
"""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from khepera_emulator.arenas.arena import Start
from khepera_emulator.world.floor_plan import FloorPlan

_FINEST: Final = 0.0025
"""Metres of a square's side at least."""

_MOST_SQUARES: Final = 2000
"""Squares along the longer side of an arena."""

_ERROR: Final = 2.0
"""Squares by which a solid may be drawn too large."""

_BITS: Final = 4
"""Of a coordinate's fraction, as OpenCV draws."""

_REACHED: Final = 2


class Enclosure:
    """The inside of an arena, for a round body.

    Args:
        plan: the arena's walls and posts.
        start: where robots are, by the arena's own word.
        radius: of the body in metres; narrower openings count as closed.
    """

    def __init__(self, plan: FloorPlan, start: Start, radius: float) -> None:
        (x0, y0), (x1, y1) = plan.bounds()
        self._side = max(_FINEST, max(x1 - x0, y1 - y0) / _MOST_SQUARES)
        margin = 2 * radius + 4 * self._side
        self._corner = x0 - margin, y0 - margin
        self._rows, self._columns = (
            round((last - first + 2 * margin) / self._side) for first, last in ((y0, y1), (x0, x1))
        )
        self._outside: NDArray[np.bool_] | None = None
        outside = self._reached(plan, max(radius - _ERROR * self._side, self._side))
        row, column = self._square(start.x, start.y)
        if 0 <= row < self._rows and 0 <= column < self._columns and not outside[row, column]:
            self._outside = outside

    def holds(self, x: float, y: float) -> bool:
        """Tell whether a body that fits at a place, in metres, is not outside the walls."""
        if self._outside is None:
            return True
        row, column = self._square(x, y)
        if not (0 <= row < self._rows and 0 <= column < self._columns):
            return False
        return not self._outside[row, column]

    def _square(self, x: float, y: float) -> tuple[int, int]:
        x0, y0 = self._corner
        return int((y - y0) // self._side), int((x - x0) // self._side)

    def _reached(self, plan: FloorPlan, radius: float) -> NDArray[np.bool_]:
        """Find the squares that a body gets to which comes from far away."""
        floor = np.zeros((self._rows, self._columns), np.uint8)
        # a solid, and as much around it as keeps the body's middle away
        around = round(2 * radius / self._side)
        for box in plan.boxes:
            corners = self._drawn(box.corners())
            cv2.fillConvexPoly(floor, corners, 1, shift=_BITS)
            cv2.polylines(floor, [corners], True, 1, around, shift=_BITS)
        for x, y, size in plan.posts:
            ((column, row),) = self._drawn([(x, y)]).tolist()
            reach = round((size + radius) / self._side * 2**_BITS)
            cv2.circle(floor, (column, row), reach, 1, cv2.FILLED, shift=_BITS)
        cv2.floodFill(floor, None, (0, 0), _REACHED)
        return np.asarray(floor == _REACHED)

    def _drawn(self, points: list[tuple[float, float]]) -> NDArray[np.int32]:
        """Convert points in metres to squares, from middle to middle, as OpenCV takes them."""
        squares = (np.array(points) - self._corner) / self._side - 0.5
        return np.rint(squares * 2**_BITS).astype(np.int32)
