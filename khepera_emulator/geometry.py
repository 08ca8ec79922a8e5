"""The arena seen from above: solids that rays hit and bodies keep away from.

Walls and posts are upright, so that at the height of a robot everything is plane geometry. This
is the fast path for sensors and free space; the tests hold it against PyBullet's own rays.
"""

from dataclasses import dataclass
from math import hypot

import numpy as np
from numpy.typing import NDArray

from khepera_emulator.arena import Arena, Wall

Array = NDArray[np.float64]


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
        shape = [(b.x, b.y, b.ux, b.uy, b.half_length, b.half_thickness) for b in self.boxes]
        columns = np.array(shape, dtype=float).reshape(-1, 6).T
        self._centre, self._along = columns[0:2], columns[2:4]
        self._half = columns[4:6]
        self._posts = np.array(self.posts, dtype=float).reshape(-1, 3).T
        walls = [box.colour for box in self.boxes]
        grey = [sum(colour) / 3 for colour in walls + [post.colour for post in arena.cylinder]]
        self._grey = np.array([*grey, 1.0])

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
        distances = np.full((len(origins), 1 + len(self.boxes) + len(self.posts)), np.inf)
        if self.boxes:
            distances[:, : len(self.boxes)] = self._cast_boxes(origins, directions)
        if self.posts:
            distances[:, len(self.boxes) : -1] = self._cast_posts(origins, directions)
        hit = distances.argmin(axis=1)
        return distances[np.arange(len(hit)), hit], self._grey[hit]

    def _cast_boxes(self, origins: Array, directions: Array) -> Array:
        (ux, uy), half = self._along, self._half[:, None, :]
        dx = origins[:, 0, None] - self._centre[0]
        dy = origins[:, 1, None] - self._centre[1]
        vx, vy = directions[:, 0, None], directions[:, 1, None]
        start = np.stack([dx * ux + dy * uy, dy * ux - dx * uy])
        ray = np.stack([vx * ux + vy * uy, vy * ux - vx * uy])
        with np.errstate(divide="ignore", invalid="ignore"):
            near = (-np.copysign(half, ray) - start) / ray
            far = (np.copysign(half, ray) - start) / ray
        # a ray along a face (0 / 0) neither enters nor leaves through it
        enter = np.nan_to_num(near, nan=-np.inf, posinf=np.inf, neginf=-np.inf).max(axis=0)
        leave = np.nan_to_num(far, nan=np.inf, posinf=np.inf, neginf=-np.inf).min(axis=0)
        return np.where((leave >= np.maximum(enter, 0.0)), np.maximum(enter, 0.0), np.inf)

    def _cast_posts(self, origins: Array, directions: Array) -> Array:
        px, py, radius = self._posts
        dx, dy = px - origins[:, 0, None], py - origins[:, 1, None]
        along = dx * directions[:, 0, None] + dy * directions[:, 1, None]
        beside = dx * directions[:, 1, None] - dy * directions[:, 0, None]
        inside = radius**2 - beside**2
        reach = along - np.sqrt(np.maximum(inside, 0.0))
        hit = (inside >= 0.0) & (along + np.sqrt(np.maximum(inside, 0.0)) >= 0.0)
        return np.where(hit, np.maximum(reach, 0.0), np.inf)
