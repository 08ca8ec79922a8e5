"""The ground of a chart: how much room there is at each place, and where a goal was seen."""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from macor_hil.arrays import Array, Indices, Mask
from macor_hil.mind.foresight.chart.views import Floats
from macor_hil.mind.foresight.floor import joined, line_of
from macor_hil.mind.foresight.motions import moved

CELL: Final = 0.1
"""Heights: side of the cells."""

_FAR: Final = 5.0
"""Heights up to which the floor's end is measured well enough for a cell."""

_AROUND: Final = 2.5
"""Heights beside all poses that belong to the ground."""

_MOST: Final = 600
"""Cells to a side: 3.6 m."""

_SHIFT: Final = 4
"""Binary places of OpenCV's coordinates."""

_SEEN: Final = 2
"""Views that must have seen a cell as floor."""

_AROUND_A_CELL: Final = (5, 9, 17, 33)
"""Cells to the side of the squares whose views tell whether a goal is seen at their middle; the
smallest one counts that has enough views."""

_VIEWS: Final = 6
"""Views that are enough: one that is misplaced does not make a goal."""

_LEAST: Final = 0.3
_ENOUGH: Final = 0.6
"""Shares of the views up to which a goal is not there, and from which on it is."""


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """A raster of places.

    Attributes:
        origin: place of the middle of the first cell, in heights.
        clearance: heights to what is no floor or was never seen, shape (rows, columns).
    """

    origin: Array
    clearance: Floats

    def places(self, poses: Array) -> Array:
        """Return columns and rows of poses, with fractions, shape (..., 2)."""
        places: Array = (poses[..., :2] - self.origin) / CELL
        return places

    def reward(self, poses: Array, seen: Mask) -> Floats:
        """Return how certain it is that a goal is seen at each cell, 0 to 1.

        Args:
            poses: of views, shape (N, 3).
            seen: whether they show it, shape (N,).
        """
        rows, columns = self.clearance.shape
        column, row = np.rint(self.places(poses)).astype(np.int64).T
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        cell = (row * columns + column)[inside]
        counts = [
            np.bincount(cell, weight[inside], rows * columns).reshape(rows, columns)
            for weight in (np.ones(len(poses)), seen.astype(float))
        ]
        share, unknown = np.zeros((rows, columns)), np.ones((rows, columns), np.bool_)
        for side in _AROUND_A_CELL:
            every, some = (
                cv2.boxFilter(
                    one, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT
                )
                for one in counts
            )
            enough = unknown & (every > _VIEWS - 0.5)
            share[enough] = some[enough] / every[enough]
            unknown &= ~enough
        certain: Floats = np.clip((share - _LEAST) / (_ENOUGH - _LEAST), 0.0, 1.0)
        return certain.astype(np.float32)


def ground_of(poses: Array, profiles: Floats) -> Ground:
    """Return the ground that views show: floor is what more of them saw free than as an end.

    Args:
        poses: of views, shape (N, 3).
        profiles: their inverse distances of the floor's end, shape (N, directions).
    """
    low = poses[:, :2].min(axis=0) - _AROUND
    size = np.ceil((poses[:, :2].max(axis=0) + _AROUND - low) / CELL).astype(int)
    columns, rows = np.minimum(size, _MOST).tolist()
    free, solid = np.zeros((2, rows, columns), np.int32)
    for pose, profile in zip(poses, np.maximum(profiles, 1.0 / _FAR), strict=True):
        line = line_of(profile)
        corners = _cells(moved(pose, _as_poses(line)), low)
        pieces = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
        ends = joined(profile, line) & (profile > 1.0 / _FAR)
        # only the part of the raster that the view shows
        first = np.clip((corners.min(axis=0) >> _SHIFT) - 1, 0, [columns, rows])
        last = np.clip((corners.max(axis=0) >> _SHIFT) + 2, 0, [columns, rows])
        window = (slice(first[1], last[1]), slice(first[0], last[0]))
        part = np.zeros((last[1] - first[1], last[0] - first[0]), np.uint8)
        if not part.size:
            continue
        offset = (first << _SHIFT).astype(np.int32)
        cv2.fillPoly(part, [corners - offset], 1, cv2.LINE_8, _SHIFT)
        free[window] += part
        part[:] = 0
        cv2.polylines(part, list(pieces[ends] - offset), False, 1, 1, cv2.LINE_8, _SHIFT)
        solid[window] += part
    floor = ((free - solid > solid) & (free >= _SEEN)).astype(np.uint8)
    distance = cv2.distanceTransform(np.pad(floor, 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    return Ground(low, np.maximum(distance - 0.5, 0.0).astype(np.float32) * np.float32(CELL))


def _as_poses(places: Array) -> Array:
    return np.column_stack([places, np.zeros(len(places))])


def _cells(poses: Array, low: Array) -> Indices:
    cells: Indices = np.rint((poses[:, :2] - low) / CELL * (1 << _SHIFT)).astype(np.int32)
    return cells
