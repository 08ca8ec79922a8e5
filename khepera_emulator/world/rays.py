"""Many rays at once against boxes and discs, seen from above, in NumPy."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEVER = 1e200
"""Metres after which a ray along a face meets it."""


def to_boxes(
    origins: Array, directions: Array, axes: Array, offsets: Array, halves: Array
) -> Array:
    """Return the distance of each ray to each box, (N, boxes): where it is between all four faces.

    The columns of `axes` are unit vectors, every box's along its length and then every box's
    across; `offsets` are the centres and `halves` the half sizes along them.
    """
    count = len(halves) // 2
    # a ray along a face never crosses it
    inverse = 1.0 / (directions @ axes + 1.0 / NEVER)
    middle = (offsets - origins @ axes) * inverse
    half = halves * np.abs(inverse)
    near, far = middle - half, middle + half
    enter = np.maximum(np.maximum(near[:, :count], near[:, count:]), 0.0)
    leave = np.minimum(far[:, :count], far[:, count:])
    return np.where(leave >= enter, enter, np.inf)


def to_discs(origins: Array, directions: Array, discs: Array) -> Array:
    """Return distances of rays to discs, (N, discs); rows of `discs`: x, y and radius."""
    px, py, radius = discs
    dx, dy = px - origins[:, 0, None], py - origins[:, 1, None]
    along = dx * directions[:, 0, None] + dy * directions[:, 1, None]
    beside = dx * directions[:, 1, None] - dy * directions[:, 0, None]
    inside = radius**2 - beside**2
    reach = along - np.sqrt(np.maximum(inside, 0.0))
    hit = (inside >= 0.0) & (along + np.sqrt(np.maximum(inside, 0.0)) >= 0.0)
    return np.where(hit, np.maximum(reach, 0.0), np.inf)
