"""Columns of the skyline, compiled; `FirstSeen` and `SkylineRenderer` are the plain form."""

from typing import Any

import numpy as np
from khepera_protocol.system.compiled import compiled

_NEVER = 1e-200


@compiled
def look_at_boxes(directions: Any, origins: Any, offsets: Any, halves: Any, sunny: Any) -> Any:
    """Return what `FirstSeen` returns of n boxes.

    Args:
        directions: of N rays along every box's two axes, shape (2 n, N).
        origins: of the rays, along the same axes, shape (2 n,).
        offsets: of the boxes' centres, shape (2 n,).
        halves: half sizes, shape (2 n,).
        sunny: parts of the light along the axes, shape (2 n,).
    """
    n, count = len(offsets) // 2, directions.shape[1]
    distances = np.full(count, np.inf)
    solids = np.zeros(count, np.int64)
    lit = np.zeros(count)
    for ray in range(count):
        nearest, first = np.inf, 0
        for box in range(n):
            enter, leave = -np.inf, np.inf
            for axis in (box, box + n):
                inverse = 1.0 / (directions[axis, ray] + _NEVER)
                middle = (offsets[axis] - origins[axis]) * inverse
                half = halves[axis] * abs(inverse)
                enter, leave = max(enter, middle - half), min(leave, middle + half)
            if leave >= enter and 0.0 < enter < nearest:
                nearest, first = enter, box
        one = 1.0 / (directions[first, ray] + _NEVER)
        other = 1.0 / (directions[first + n, ray] + _NEVER)
        near_one = (offsets[first] - origins[first]) * one - halves[first] * abs(one)
        near_other = (offsets[first + n] - origins[first + n]) * other
        near_other -= halves[first + n] * abs(other)
        along = near_one > near_other
        inverse, light = (one, sunny[first]) if along else (other, sunny[first + n])
        distances[ray], solids[ray] = nearest, first
        lit[ray] = max(-np.sign(inverse) * light, 0.0)
    return distances, solids, lit


@compiled
def paint(picture: Any, top: Any, foot: Any, colours: Any, floor: Any, sky: Any) -> None:
    """Paint floor, solids and sky.

    Args:
        picture: shape (rows, columns, 3), bytes.
        top: row of each column's upper edge, with its fraction.
        foot: row of its foot.
        colours: of the solids, shape (columns, 3), single precision.
        floor: colour of the floor, single precision.
        sky: colour of the sky, single precision.
    """
    rows, columns, _ = picture.shape
    # the first rows whose middles are below the upper edge, and below the foot
    below_top = np.floor(top - 0.5).astype(np.int64) + 1
    below_foot = np.floor(foot - 0.5).astype(np.int64) + 1
    bytes_ = colours.astype(np.uint8)
    f0, f1, f2 = np.uint8(floor[0]), np.uint8(floor[1]), np.uint8(floor[2])
    s0, s1, s2 = np.uint8(sky[0]), np.uint8(sky[1]), np.uint8(sky[2])
    for row in range(rows):
        for column in range(columns):
            b, g, r = s0, s1, s2
            if row >= below_foot[column]:
                b, g, r = f0, f1, f2
            elif row >= below_top[column]:
                b, g, r = bytes_[column, 0], bytes_[column, 1], bytes_[column, 2]
            picture[row, column, 0], picture[row, column, 1] = b, g
            picture[row, column, 2] = r
    for edges in (top, foot):
        for column in range(columns):
            row = min(max(int(edges[column]), 0), rows - 1)
            wall = min(max(row + 1 - top[column], 0.0), 1.0)
            ground = min(max(row + 1 - foot[column], 0.0), 1.0)
            for c in range(3):
                solid = colours[column, c]
                level = sky[c] + wall * (solid - sky[c]) + ground * (floor[c] - solid)
                picture[row, column, c] = np.uint8(level)
