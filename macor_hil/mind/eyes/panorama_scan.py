"""Means, floor and sights of a panorama, compiled; `floor_profile` and `sights` are plain forms."""

from typing import Any

import numpy as np
from khepera_protocol.system.compiled import compiled, part


@compiled
def scan(panorama: Any, lowest: int, contrast: float) -> Any:
    """Return what `floor_profile` finds before elevations come in, and the means of all columns.

    Args:
        panorama: shape (rows, columns, 3), bytes.
        lowest: rows that show the floor.
        contrast: grey levels.

    Returns:
        Mean of each channel in each column, shape (columns, 3); place of the floor's end in each
        column in rows from the top; whether it ends at all, shape (columns,).
    """
    rows, columns, _ = panorama.shape
    means = np.zeros((columns, 3))
    for row in range(rows):
        for column in range(columns):
            for c in range(3):
                means[column, c] += panorama[row, column, c]
    means /= rows
    apart = np.empty((rows, columns, 3), np.float32)
    floor = _medians(panorama[rows - lowest :])
    for row in range(rows):
        for column in range(columns):
            for c in range(3):
                apart[row, column, c] = np.float32(panorama[row, column, c]) - floor[c]
    edges, found = np.empty(columns), np.zeros(columns, np.bool_)
    for column in range(columns):
        end, below = rows - 1, False
        for row in range(rows - 1, -1, -1):
            differs = _differs(apart[row, column], contrast)
            if below and differs:
                end, found[column] = row + 1, True
                break
            below = differs
        edges[column] = _edge(apart, end, column)
    return means, edges, found


@part
def _differs(apart: Any, contrast: float) -> bool:
    return bool(max(abs(apart[0]), abs(apart[1]), abs(apart[2])) > contrast)


@part
def _edge(apart: Any, row: int, column: int) -> float:
    """Return the place of an edge near a row, as a fraction of rows from the top."""
    rows = len(apart)
    solid = apart[max(row - 2, 0), column]
    size = max(solid[0] * solid[0] + solid[1] * solid[1] + solid[2] * solid[2], np.float32(1.0))
    total = np.float32(0.0)
    for at in range(row - 1, row + 3):
        share = np.float32(1.0)
        if at < rows:
            pixel = apart[max(at, 0), column]
            dot = pixel[0] * solid[0] + pixel[1] * solid[1] + pixel[2] * solid[2]
            share = min(max(dot / size, np.float32(0.0)), np.float32(1.0))
        total += share
    return float(row - 1.0 + total)


@part
def _medians(levels: Any) -> Any:
    """Return the median of an even number of levels in each channel."""
    rows, columns, _ = levels.shape
    half = rows * columns // 2
    medians = np.empty(3, np.float32)
    for c in range(3):
        counts = np.zeros(256, np.int64)
        for row in range(rows):
            for column in range(columns):
                counts[levels[row, column, c]] += 1
        below, low = 0, -1
        for level in range(256):
            below += counts[level]
            if low < 0 and below >= half:
                low = level
            if below > half:
                medians[c] = np.float32(low + level) / np.float32(2.0)
                break
    return medians


@compiled
def sights(panorama: Any, grey: Any, foot: Any, begins: Any) -> Any:
    """Return the sights of a panorama, shape (sectors, 5).

    Args:
        panorama: shape (rows, columns, 3), bytes.
        grey: its brightness, shape (rows, columns), bytes.
        foot: row above the floor's end of each column, shape (columns,).
        begins: first column of each sector, and the number of columns, shape (sectors + 1,).
    """
    rows = len(panorama)
    sectors = len(begins) - 1
    seen = np.zeros((sectors, 5))
    for sector in range(sectors):
        first, end = begins[sector], max(begins[sector + 1], begins[sector] + 1)
        for column in range(first, end):
            for c in range(3):
                seen[sector, c] += panorama[foot[column], column, c]
        for c in range(3):
            seen[sector, c] = seen[sector, c] / max(begins[sector + 1] - first, 1) / 255.0
        light, brightest = -1, 0
        for row in range(rows):
            for column in range(first, end):
                if grey[row, column] > light:
                    light, brightest = grey[row, column], row
        seen[sector, 3], seen[sector, 4] = light / 255.0, 1.0 - brightest / rows
    return seen
