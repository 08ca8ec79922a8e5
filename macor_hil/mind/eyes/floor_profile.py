"""The floor's end in every direction, seen in a panorama: a range scan by one camera.

A mirror of known geometry, at a fixed height above a plain floor, sees what is at distance d under
the depression atan(height / d). So the row in which a column's floor ends tells how far the robot
could drive there, in units of the camera's height, which need not be known. Resolution is finest
where it matters: about a millimetre at 10 cm, 3 mm at 30 cm.

Limits: the floor has one colour, other than that of what stands on it by more than `contrast`
in one channel; the lowest two rows of the panorama show the floor, and not the robot itself.
"""

from typing import Final

import numpy as np
from khepera_protocol.mirror import Mirror

from macor_hil.arrays import Array, Image, Levels, Mask

FARTHEST: Final = 25.0
"""Heights of the camera beyond which all distances count as this one."""

NEAREST: Final = 0.125
"""Heights of the camera below which all distances count as this one."""

LOWEST: Final = 2
"""Rows of the panorama that show the floor beside the robot."""


def azimuths(columns: int) -> Array:
    """Return the direction of each column in radians, to the left of straight ahead."""
    directions: Array = np.pi - (np.arange(columns) + 0.5) * 2 * np.pi / columns
    return directions


def floor_profile(panorama: Image, mirror: Mirror, contrast: float) -> Array:
    """Return the inverse distance of the floor's end in each column, shape (columns,).

    From the lowest row up, the floor ends where two rows in a row look otherwise. Where within the
    row follows from how far the colour has gone from the floor's to that of what stands there.

    Args:
        panorama: top row at the mirror's highest elevation.
        mirror: elevations of the panorama's rows.
        contrast: grey levels by which a channel differs from the floor's at least.
    """
    rows = len(panorama)
    apart: Levels = panorama.astype(np.float32)
    apart -= _median(apart[-LOWEST:].reshape(-1, 3))
    # a reduction over an axis of three is slow
    blue, green, red = np.moveaxis(np.abs(apart), 2, 0)
    differs = np.maximum(np.maximum(blue, green), red) > contrast
    ends = differs.copy()
    ends[1:] &= differs[:-1]
    ends[0] = False
    row = rows - 1 - np.argmax(ends[::-1], axis=0)
    return profile_of(_within_row(apart, row), ends.any(axis=0), rows, mirror)


def profile_of(edges: Array, found: Mask, rows: int, mirror: Mirror) -> Array:
    """Return the inverse distance of the floor's end in each column, shape (columns,).

    Args:
        edges: its place in rows from the top, shape (columns,).
        found: whether the floor ends at all, shape (columns,).
        rows: of the panorama.
        mirror: elevations of the panorama's rows.
    """
    elevation = mirror.high - edges * (mirror.high - mirror.low) / rows
    depression = np.where(found, np.clip(-elevation, 0.0, np.pi / 2 - 1e-3), 0.0)
    profile: Array = np.clip(np.tan(depression), 1 / FARTHEST, 1 / NEAREST)
    return profile


def _within_row(apart: Levels, row: Array) -> Array:
    """Return the place of an edge near a row of each column, as a fraction of rows from the top.

    Args:
        apart: difference of each pixel from the floor's colour, shape (rows, columns, 3).
        row: lowest row of what stands there, shape (columns,).
    """
    rows, columns, _ = apart.shape
    column = np.arange(columns)
    solid = apart[np.maximum(row - 2, 0), column]
    size = np.maximum(np.einsum("ij,ij->i", solid, solid), 1.0)
    at = row + np.arange(-1, 3)[:, np.newaxis]
    pixel = apart[np.minimum(np.maximum(at, 0), rows - 1), column]
    share = np.einsum("aij,ij->ai", pixel, solid) / size
    share = np.where(at < rows, np.minimum(np.maximum(share, 0.0), 1.0), 1.0)
    edge: Array = row - 1.0 + share.sum(axis=0)
    return edge


def _median(values: Levels) -> Levels:
    """Return the median of each column of an even number of rows, as `np.median` does, faster."""
    middle = len(values) // 2
    ordered = np.partition(values, (middle - 1, middle), axis=0)
    median: Levels = (ordered[middle - 1] + ordered[middle]) / 2
    return median
