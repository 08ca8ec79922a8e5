"""The arena seen from above: solids that rays hit and bodies keep away from.

Walls and posts are upright, so that at the height of a robot everything is plane geometry. This
is the fast path for sensors and free space; the tests hold it against PyBullet's own rays.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, hypot, pi, radians, sin
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from khepera_emulator.arena import Arena, Movable, Point, Wall

Array = NDArray[np.float64]

_NEVER = 1e200
_DISC_CORNERS = 32


@dataclass(frozen=True, slots=True)
class Box:
    """An upright box: centre, unit vector along its length, half length and half thickness."""

    x: float
    y: float
    ux: float
    uy: float
    half_length: float
    half_thickness: float
    height: float
    colour: tuple[float, float, float]

    def corners(self) -> list[Point]:
        """Its four corners, in metres, one after the other around it."""
        return _box_corners(
            (self.x, self.y), (self.ux, self.uy), (self.half_length, self.half_thickness)
        )


def wall_boxes(wall: Wall) -> list[Box]:
    """The boxes of a wall, one a stretch, lengthened to close the corners."""
    boxes = []
    half = wall.thickness / 2
    for (x0, y0), (x1, y1) in zip(wall.points, wall.points[1:], strict=False):
        length = hypot(x1 - x0, y1 - y0)
        boxes.append(
            Box(
                (x0 + x1) / 2,
                (y0 + y1) / 2,
                (x1 - x0) / length,
                (y1 - y0) / length,
                length / 2 + half,
                half,
                wall.height,
                wall.colour,
            )
        )
    return boxes


class FloorPlan:
    """Distances in an arena, from above."""

    def __init__(self, arena: Arena) -> None:
        self.boxes = [box for wall in arena.wall for box in wall_boxes(wall)]
        self.posts = [(*post.centre, post.radius) for post in arena.cylinder]
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
        walls = [box.colour for box in self.boxes]
        grey = [sum(colour) / 3 for colour in walls + [post.colour for post in arena.cylinder]]
        self._grey = np.array([*grey, 1.0])

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
        """Distance in metres from a point to the nearest solid; 0 or less inside one."""
        nearest = float("inf")
        for box in self.boxes:
            dx, dy = x - box.x, y - box.y
            along = abs(dx * box.ux + dy * box.uy) - box.half_length
            across = abs(dy * box.ux - dx * box.uy) - box.half_thickness
            if along <= 0.0 or across <= 0.0:
                nearest = min(nearest, max(along, across))
            else:
                nearest = min(nearest, hypot(along, across))
        for px, py, radius in self.posts:
            nearest = min(nearest, hypot(x - px, y - py) - radius)
        return nearest

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
            solids.append(_to_boxes(origins, directions, self._axes, self._offsets, self._halves))
        if self.posts:
            solids.append(_to_discs(origins, directions, self._posts))
        if not solids:
            return np.full(len(origins), np.inf), np.ones(len(origins))
        distances = solids[0] if len(solids) == 1 else np.concatenate(solids, axis=1)
        hit = distances.argmin(axis=1)
        nearest = distances[np.arange(len(hit)), hit]
        return nearest, np.where(nearest < np.inf, self._grey[hit], 1.0)


class Scene(Protocol):
    """What sensors look at and bodies keep away from."""

    def clearance(self, x: float, y: float) -> float:
        """Distance in metres from a point to the nearest solid; 0 or less inside one."""

    def cast(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Follow rays to the first solid; see `FloorPlan.cast`."""


class Footprint(Protocol):
    """Something that may stand elsewhere in the next moment.

    Attributes:
        grey: how bright infrared finds it, 0 to 1.
        reach: metres that it may move in the next control period.
    """

    grey: float
    reach: float

    def gap(self, x: float, y: float) -> float:
        """Distance in metres from a point to its surface; 0 or less inside."""

    def hit(self, origins: Array, directions: Array) -> Array:
        """Distance in metres that each of N rays goes to reach it, infinite if it misses."""


class Disc:
    """Footprint of something round."""

    def __init__(self, x: float, y: float, radius: float, grey: float) -> None:
        self.x, self.y = x, y
        self.radius = radius
        self.grey = grey
        self.reach = 0.0

    def gap(self, x: float, y: float) -> float:
        """Distance in metres from a point to its surface; 0 or less inside."""
        return hypot(x - self.x, y - self.y) - self.radius

    def hit(self, origins: Array, directions: Array) -> Array:
        """Distance in metres that each of N rays goes to reach it, infinite if it misses."""
        disc = np.array([[self.x], [self.y], [self.radius]])
        distances: Array = _to_discs(origins, directions, disc)[:, 0]
        return distances

    def corners(self) -> list[Point]:
        """Corners of a polygon that is drawn for it, in metres."""
        angles = [2 * pi * k / _DISC_CORNERS for k in range(_DISC_CORNERS)]
        return [
            (self.x + self.radius * cos(angle), self.y + self.radius * sin(angle))
            for angle in angles
        ]


class Brick:
    """Footprint of a box, its length along its heading."""

    def __init__(
        self, x: float, y: float, heading: float, size: tuple[float, float], grey: float
    ) -> None:
        self.x, self.y, self.heading = x, y, heading
        self.half_length, self.half_width = size[0] / 2, size[1] / 2
        self.grey = grey
        self.reach = 0.0

    def gap(self, x: float, y: float) -> float:
        """Distance in metres from a point to its surface; 0 or less inside."""
        dx, dy = x - self.x, y - self.y
        c, s = cos(self.heading), sin(self.heading)
        along = abs(dx * c + dy * s) - self.half_length
        across = abs(dy * c - dx * s) - self.half_width
        if along <= 0.0 or across <= 0.0:
            return max(along, across)
        return hypot(along, across)

    def hit(self, origins: Array, directions: Array) -> Array:
        """Distance in metres that each of N rays goes to reach it, infinite if it misses."""
        c, s = cos(self.heading), sin(self.heading)
        axes = np.array([[c, -s], [s, c]])
        halves = np.array([self.half_length, self.half_width])
        offsets = np.array([self.x, self.y]) @ axes
        distances: Array = _to_boxes(origins, directions, axes, offsets, halves)[:, 0]
        return distances

    def corners(self) -> list[Point]:
        """Its four corners, in metres, one after the other around it."""
        return _box_corners(
            (self.x, self.y),
            (cos(self.heading), sin(self.heading)),
            (self.half_length, self.half_width),
        )


def footprint(part: Movable) -> Disc | Brick:
    """What a thing covers of the floor where the arena puts it."""
    x, y = part.centre
    grey = sum(part.colour) / 3
    if part.size is not None:
        return Brick(x, y, radians(part.heading), part.size, grey)
    return Disc(x, y, part.radius or 0.0, grey)


class Surroundings:
    """A scene of a floor plan and of what moves in it.

    Args:
        plan: what stands still.
        movers: what moves; the sequence may grow, and its members move, after this is made.
        own: the one among the movers that looks, which does not see itself.
    """

    def __init__(
        self, plan: FloorPlan, movers: Sequence[Footprint], own: Footprint | None = None
    ) -> None:
        self._plan = plan
        self._movers = movers
        self._own = own

    def others(self) -> list[Footprint]:
        """All that moves, but for the one that looks."""
        return [mover for mover in self._movers if mover is not self._own]

    def clearance(self, x: float, y: float) -> float:
        """Distance in metres from a point to the nearest solid; 0 or less inside one."""
        gaps = [mover.gap(x, y) for mover in self.others()]
        return min(self._plan.clearance(x, y), *gaps) if gaps else self._plan.clearance(x, y)

    def cast(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Follow rays to the first solid; see `FloorPlan.cast`."""
        nearest, grey = self._plan.cast(origins, directions)
        for mover in self.others():
            distances = mover.hit(origins, directions)
            first = distances < nearest
            nearest = np.where(first, distances, nearest)
            grey = np.where(first, mover.grey, grey)
        return nearest, grey


def _box_corners(centre: Point, along: Point, halves: Point) -> list[Point]:
    (x, y), (ux, uy), (length, width) = centre, along, halves
    return [
        (x + a * length * ux - b * width * uy, y + a * length * uy + b * width * ux)
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]


def _to_boxes(
    origins: Array, directions: Array, axes: Array, offsets: Array, halves: Array
) -> Array:
    """Distance of each ray to each box, (N, boxes): where it is between all four faces.

    The columns of `axes` are unit vectors, every box's along its length and then every box's
    across; `offsets` are the centres and `halves` the half sizes along them.
    """
    count = len(halves) // 2
    # a ray along a face never crosses it: as good as never is after _NEVER metres
    inverse = 1.0 / (directions @ axes + 1.0 / _NEVER)
    middle = (offsets - origins @ axes) * inverse
    half = halves * np.abs(inverse)
    near, far = middle - half, middle + half
    enter = np.maximum(np.maximum(near[:, :count], near[:, count:]), 0.0)
    leave = np.minimum(far[:, :count], far[:, count:])
    return np.where(leave >= enter, enter, np.inf)


def _to_discs(origins: Array, directions: Array, discs: Array) -> Array:
    """Distance of each ray to each disc, (N, discs); rows of `discs`: x, y and radius."""
    px, py, radius = discs
    dx, dy = px - origins[:, 0, None], py - origins[:, 1, None]
    along = dx * directions[:, 0, None] + dy * directions[:, 1, None]
    beside = dx * directions[:, 1, None] - dy * directions[:, 0, None]
    inside = radius**2 - beside**2
    reach = along - np.sqrt(np.maximum(inside, 0.0))
    hit = (inside >= 0.0) & (along + np.sqrt(np.maximum(inside, 0.0)) >= 0.0)
    return np.where(hit, np.maximum(reach, 0.0), np.inf)
