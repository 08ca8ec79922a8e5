"""The arena seen from above: solids that rays hit and bodies keep away from.

Walls and posts are upright, so that at the height of a robot everything is plane geometry. This
is the fast path for sensors and free space; the tests hold it against PyBullet's own rays.
"""

from collections.abc import Callable, Iterable, Sequence
from math import floor
from typing import Protocol

import numpy as np

from khepera_emulator.arenas.arena import Arena, Point
from khepera_emulator.world.rays import Array, to_boxes, to_discs
from khepera_emulator.world.solids import Disc, Footprint, Solid, wall_boxes

_SQUARE = 0.05
"""Side in metres of the squares of floor for which it is remembered what is near."""

_REMEMBERED = 20_000
"""Squares at most, whatever way a robot takes over an endless floor."""

_HALF_DIAGONAL = _SQUARE * 0.7072

NEAR = 0.15
"""Metres within which a floor plan can tell what is near: a Khepera's body and its sight."""


class Scene(Protocol):
    """Surroundings that sensors look at and bodies keep away from."""

    def clearance(self, x: float, y: float) -> float:
        """Return the distance in metres from a point to the nearest solid; 0 or less inside one."""

    def near(self, x: float, y: float, reach: float) -> list[Solid]:
        """Return the solids no further than a reach, up to `NEAR` metres, from a point."""

    def cast(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Follow rays to the first solid; see `FloorPlan.cast`."""


class FloorPlan:
    """Distances in an arena, from above.

    Attributes:
        boxes: the stretches of all walls.
        posts: centre and radius of each post, in metres.
        discs: the same posts as solids.
    """

    def __init__(self, arena: Arena) -> None:
        self.boxes = [box for wall in arena.wall for box in wall_boxes(wall)]
        self.posts = [(*post.centre, post.radius) for post in arena.cylinder]
        shades = [sum(post.colour) / 3 for post in arena.cylinder]
        self.discs = [Disc(*post, grey) for post, grey in zip(self.posts, shades, strict=True)]
        self._solids: tuple[Solid, ...] = (*self.boxes, *self.discs)
        self._squares: dict[tuple[int, int], tuple[Solid, ...]] = {}
        along = np.array([(b.ux, b.uy) for b in self.boxes]).reshape(-1, 2)
        across = along[:, ::-1] * (-1.0, 1.0)
        centres = np.array([(b.x, b.y) for b in self.boxes]).reshape(-1, 2)
        # columns: every box's axis along its length, then every box's axis across
        self._axes = np.concatenate([along, across]).T
        self._offsets = (np.tile(centres, (2, 1)) * self._axes.T).sum(axis=1)
        self._halves = np.array(
            [b.half_length for b in self.boxes] + [b.half_thickness for b in self.boxes]
        )
        self._posts = np.array(self.posts, dtype=float).reshape(-1, 3).T
        self._grey = np.array([*(solid.grey for solid in self._solids), 1.0])

    def bounds(self) -> tuple[Point, Point]:
        """Lower left and upper right corner of everything, in metres; empty: twice the origin."""
        corners = [corner for box in self.boxes for corner in box.corners()]
        for x, y, radius in self.posts:
            corners += [(x - radius, y - radius), (x + radius, y + radius)]
        if not corners:
            return (0.0, 0.0), (0.0, 0.0)
        xs, ys = zip(*corners, strict=True)
        return (min(xs), min(ys)), (max(xs), max(ys))

    def clearance(self, x: float, y: float) -> float:
        """Return the distance in metres from a point to the nearest solid; 0 or less inside one."""
        return min([solid.gap(x, y) for solid in self._around(x, y)], default=float("inf"))

    def near(self, x: float, y: float, reach: float) -> list[Solid]:
        """Return the solids no further than a reach, up to `NEAR` metres, from a point."""
        return [solid for solid in self._around(x, y) if solid.gap(x, y) <= reach]

    def cast(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Follow rays to the first solid.

        Args:
            origins: shape (N, 2), metres.
            directions: unit vectors, shape (N, 2).

        Returns:
            The distances in metres, infinite without a hit, and the grey values (0 to 1) of what
            was hit, both of shape (N,).
        """
        solids = []
        if self.boxes:
            solids.append(to_boxes(origins, directions, self._axes, self._offsets, self._halves))
        if self.posts:
            solids.append(to_discs(origins, directions, self._posts))
        if not solids:
            return np.full(len(origins), np.inf), np.ones(len(origins))
        distances = solids[0] if len(solids) == 1 else np.concatenate(solids, axis=1)
        hit = distances.argmin(axis=1)
        nearest = distances[np.arange(len(hit)), hit]
        return nearest, np.where(nearest < np.inf, self._grey[hit], 1.0)

    def _around(self, x: float, y: float) -> tuple[Solid, ...]:
        """Find the solids that can be the nearest, or near, to any point of a point's square."""
        square = floor(x / _SQUARE), floor(y / _SQUARE)
        found = self._squares.get(square)
        if found is None:
            middle = (square[0] + 0.5) * _SQUARE, (square[1] + 0.5) * _SQUARE
            gaps = [solid.gap(*middle) for solid in self._solids]
            # to each point of the square all gaps are those to its middle, give or take half a
            # diagonal
            limit = max(NEAR, min(gaps, default=0.0) + _HALF_DIAGONAL) + _HALF_DIAGONAL
            found = tuple(
                solid for solid, gap in zip(self._solids, gaps, strict=True) if gap <= limit
            )
            if len(self._squares) >= _REMEMBERED:
                self._squares.clear()
            self._squares[square] = found
        return found


Around = Callable[[float, float], Iterable[Footprint]]
"""Tells what of all that moves may be near a point, in metres."""


class Surroundings:
    """A scene of a floor plan and of what moves in it.

    Args:
        plan: what stands still.
        movers: what moves; the sequence may grow, and its members move, after this is made.
        own: the one among the movers that looks, which does not see itself.
        around: tells which movers can be within `NEAR` of a point; None: all.
    """

    def __init__(
        self,
        plan: FloorPlan,
        movers: Sequence[Footprint],
        own: Footprint | None = None,
        around: Around | None = None,
    ) -> None:
        self._plan = plan
        self._movers = movers
        self._own = own
        self._around = around or (lambda _x, _y: movers)

    def others(self) -> list[Footprint]:
        """Return all that moves, but for the one that looks."""
        return [mover for mover in self._movers if mover is not self._own]

    def clearance(self, x: float, y: float) -> float:
        """Return the distance in metres from a point to the nearest solid; 0 or less inside one."""
        gaps = [mover.gap(x, y) for mover in self.others()]
        return min(self._plan.clearance(x, y), *gaps) if gaps else self._plan.clearance(x, y)

    def near(self, x: float, y: float, reach: float) -> list[Solid]:
        """Return the solids no further than a reach, up to `NEAR` metres, from a point."""
        movers = [each for each in self.around(x, y) if each.gap(x, y) <= reach]
        return [*self._plan.near(x, y, reach), *movers]

    def around(self, x: float, y: float) -> list[Footprint]:
        """Return all others that can be within `NEAR` of a point."""
        own = self._own
        return [mover for mover in self._around(x, y) if mover is not own]

    def cast(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Follow rays to the first solid; see `FloorPlan.cast`."""
        nearest, grey = self._plan.cast(origins, directions)
        for mover in self.others():
            distances = mover.hit(origins, directions)
            first = distances < nearest
            nearest = np.where(first, distances, nearest)
            grey = np.where(first, mover.grey, grey)
        return nearest, grey
