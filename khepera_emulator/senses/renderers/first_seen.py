"""Faces that rays from one point meet first, and the light that these get."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from khepera_protocol.system.compiled import Kernel
from numpy.typing import NDArray

from khepera_emulator.world.rays import Array
from khepera_emulator.world.solids import Box

_LOOK: Final = Kernel("khepera_emulator.senses.renderers.columns:look_at_boxes", 1_000)

_NEVER = 1e-200


class Seen(NamedTuple):
    """The face that each of N rays meets first.

    Attributes:
        distances: metres, infinite where nothing is.
        solids: which, in the order boxes, posts; 0 where nothing is.
        lit: cosine between the light and the face's normal, 0 for a face in the shade.
    """

    distances: Array
    solids: NDArray[np.intp]
    lit: Array


class FirstSeen:
    """Upright boxes and round posts, looked at from anywhere.

    Args:
        boxes: straight walls.
        posts: x, y and radius of each in metres.
        sun: level part of the unit vector to the light.
    """

    def __init__(
        self, boxes: Sequence[Box], posts: Sequence[tuple[float, float, float]], sun: Array
    ) -> None:
        along = np.array([(box.ux, box.uy) for box in boxes]).reshape(-1, 2)
        across = along[:, ::-1] * (-1.0, 1.0)
        # every box's axis along its length, then every box's axis across
        self._axes = np.concatenate([along, across])
        centres = np.array([(box.x, box.y) for box in boxes]).reshape(-1, 2)
        self._offsets = (np.tile(centres, (2, 1)) * self._axes).sum(axis=1)[:, None]
        halves = [b.half_length for b in boxes] + [b.half_thickness for b in boxes]
        self._halves = np.array(halves)[:, None]
        self._flat = self._offsets[:, 0], self._halves[:, 0]
        self._sunny = self._axes @ sun
        self._boxes = len(boxes)
        self._posts = np.array(posts, dtype=float).reshape(-1, 3)
        self._sun = sun

    def look(self, x: float, y: float, rays: Array) -> Seen:
        """Follow rays.

        Args:
            x: of the point that they come from, in metres.
            y: likewise.
            rays: unit vectors, shape (2, N).
        """
        count = rays.shape[1]
        every = np.arange(count)
        seen = Seen(np.full(count, np.inf), np.zeros(count, np.intp), np.zeros(count))
        if self._boxes:
            seen = self._look_at_boxes(x, y, rays, every)
        if len(self._posts):
            other = self._look_at_posts(x, y, rays, every)
            nearer = other.distances < seen.distances
            seen = Seen(*(np.where(nearer, b, a) for a, b in zip(seen, other, strict=True)))
        return seen

    def _look_at_boxes(self, x: float, y: float, rays: Array, every: NDArray[np.intp]) -> Seen:
        n = self._boxes
        along, origins = self._axes @ rays, self._axes @ np.array([[x], [y]])
        arguments = along, origins[:, 0], *self._flat, self._sunny
        if _LOOK.pays(*arguments):
            return Seen(*_LOOK(*arguments))
        # a ray along a face never crosses it
        inverse = 1.0 / (along + _NEVER)
        middle = (self._offsets - origins) * inverse
        half = self._halves * np.abs(inverse)
        near, far = middle - half, middle + half
        enter = np.maximum(near[:n], near[n:])
        leave = np.minimum(far[:n], far[n:])
        distances = np.where((leave >= enter) & (enter > 0.0), enter, np.inf)
        first = distances.argmin(axis=0)
        # it came in through the axis whose faces it crossed last, against that axis or along it
        axis = np.where(near[first, every] > near[first + n, every], first, first + n)
        lit = np.maximum(-np.sign(inverse[axis, every]) * self._sunny[axis], 0.0)
        return Seen(distances[first, every], first, lit)

    def _look_at_posts(self, x: float, y: float, rays: Array, every: NDArray[np.intp]) -> Seen:
        px, py, radius = self._posts.T[:, :, None]
        dx, dy = px - x, py - y
        along = dx * rays[0] + dy * rays[1]
        beside = dx * rays[1] - dy * rays[0]
        inside = radius**2 - beside**2
        reach = along - np.sqrt(np.maximum(inside, 0.0))
        distances = np.where((inside >= 0.0) & (reach > 0.0), reach, np.inf)
        first = distances.argmin(axis=0)
        nearest = distances[first, every]
        finite = np.where(nearest < np.inf, nearest, 0.0)
        normals = (finite * rays - np.stack([dx[first, 0], dy[first, 0]])) / radius[first, 0]
        lit = np.maximum(self._sun @ normals, 0.0)
        return Seen(nearest, first + self._boxes, lit)
