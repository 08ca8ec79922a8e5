"""A raster of the floor in view: the clearance of each of its cells, read thousands of times."""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from macor_hil.arrays import Array, Indices
from macor_hil.mind.foresight.floor import joined, line_of

HALF: Final = 16.0
"""Heights from the robot to the sides of the raster."""

_CELL: Final = 0.08
_SIDE: Final = int(2 * HALF / _CELL)

STEPS: Final = 256
"""Clearances that are told apart; whatever is more than all of them counts as the greatest."""

_FINE: Final = 0.02
"""Heights between two of them."""

UNSEEN: Final = STEPS
"""Is added for cells that are hidden behind something."""

_SHIFT: Final = 4
"""Binary places of OpenCV's coordinates."""

Bins = NDArray[np.uint16]
"""Clearances as whole numbers of steps, from 0 to STEPS - 1, and UNSEEN more where hidden."""

CLEARANCES: Final[Array] = _FINE * np.arange(0.5, STEPS)
"""Clearance in heights of each bin."""


def cells_of(places: Array) -> Indices:
    """Return the cell of each place, shape (...), of places of shape (..., 2)."""
    column, row = np.moveaxis(np.clip(((places + HALF) / _CELL).astype(int), 0, _SIDE - 1), -1, 0)
    cells: Indices = row * _SIDE + column
    return cells


def bins_of(clearances: Array) -> Bins:
    """Return the bins of clearances in heights."""
    return np.minimum(clearances / _FINE, STEPS - 1).astype(np.uint16)


def raster(profile: Array) -> Bins:
    """Return the bin of every cell, shape (cells,), of a profile."""
    line = line_of(profile)
    inside = np.minimum(1.0, (HALF - 2 * _CELL) / np.abs(line).max(axis=1))
    scale = (1 << _SHIFT) / _CELL
    corners = np.round((line * inside[:, None] + HALF) * scale - (1 << _SHIFT) / 2)
    corners = corners.astype(np.int32)
    pieces = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)[joined(profile, line)]
    free = np.full((_SIDE, _SIDE), 255, np.uint8)
    cv2.polylines(free, list(pieces), False, 0, 1, cv2.LINE_8, _SHIFT)
    far = cv2.distanceTransform(free, cv2.DIST_L2, 5)
    hidden = np.full((_SIDE, _SIDE), UNSEEN, np.uint16)
    cv2.fillPoly(hidden, [corners], 0, cv2.LINE_8, _SHIFT)
    # rounded and cut off at 255
    bins = np.asarray(cv2.convertScaleAbs(far, None, _CELL / _FINE), np.uint16)
    return np.bitwise_or(hidden, bins).ravel()
