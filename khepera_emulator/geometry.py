"""The arena seen from above: solids that rays hit and bodies keep away from.

Walls and posts are upright, so that at the height of a robot everything is plane geometry. This
is the fast path for sensors and free space; the tests hold it against PyBullet's own rays.
"""

from dataclasses import dataclass
from math import hypot

import numpy as np
from numpy.typing import NDArray

from khepera_emulator.arena import Arena, Point, Wall

Array = NDArray[np.float64]

_NEVER = 1e200


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
        along = self.half_length * self.ux, self.half_length * self.uy
        across = -self.half_thickness * self.uy, self.half_thickness * self.ux
        return [
            (self.x + a * along[0] + b * across[0], self.y + a * along[1] + b * across[1])
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]


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
            solids.append(self._cast_boxes(origins, directions))
        if self.posts:
            solids.append(self._cast_posts(origins, directions))
        if not solids:
            return np.full(len(origins), np.inf), np.ones(len(origins))
        distances = solids[0] if len(solids) == 1 else np.concatenate(solids, axis=1)
        hit = distances.argmin(axis=1)
        nearest = distances[np.arange(len(hit)), hit]
        return nearest, np.where(nearest < np.inf, self._grey[hit], 1.0)

    def _cast_boxes(self, origins: Array, directions: Array) -> Array:
        """Distance of each ray to each box, (N, boxes): where it is between all four faces."""
        count = len(self.boxes)
        # a ray along a face never crosses it: as good as never is after _NEVER metres
        inverse = 1.0 / (directions @ self._axes + 1.0 / _NEVER)
        middle = (self._offsets - origins @ self._axes) * inverse
        half = self._halves * np.abs(inverse)
        near, far = middle - half, middle + half
        enter = np.maximum(np.maximum(near[:, :count], near[:, count:]), 0.0)
        leave = np.minimum(far[:, :count], far[:, count:])
        return np.where(leave >= enter, enter, np.inf)

    def _cast_posts(self, origins: Array, directions: Array) -> Array:
        px, py, radius = self._posts
        dx, dy = px - origins[:, 0, None], py - origins[:, 1, None]
        along = dx * directions[:, 0, None] + dy * directions[:, 1, None]
        beside = dx * directions[:, 1, None] - dy * directions[:, 0, None]
        inside = radius**2 - beside**2
        reach = along - np.sqrt(np.maximum(inside, 0.0))
        hit = (inside >= 0.0) & (along + np.sqrt(np.maximum(inside, 0.0)) >= 0.0)
        return np.where(hit, np.maximum(reach, 0.0), np.inf)
