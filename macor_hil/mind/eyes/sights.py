"""Sights: the colours of what stands around the robot, and the lights above it.

A goal is known by its colour, and by how near it is. In each sector this is the colour just above
the place where the floor ends, whose distance the profile tells; and the brightest spot above it,
as a lamp is, with the row that it is seen in: the higher, the nearer.
"""

from functools import lru_cache
from typing import Final

import cv2
import numpy as np
from khepera_protocol.mirror import Mirror
from khepera_protocol.system.compiled import Kernel

from macor_hil.arrays import Array, Image, Indices

SECTORS: Final = 24
"""Sectors around the robot, evenly, the first one behind its left side, clockwise."""

CHANNELS: Final = ("blue", "green", "red", "light", "row")
"""Numbers of each sector, all from 0 to 1; row: of the brightest spot, 1 is the highest."""

_SIGHTS: Final = Kernel("macor_hil.mind.eyes.panorama_scan:sights", 1_000)

_ABOVE: Final = 2
"""Rows above the floor's end, in which nothing of the floor is left."""


def brightness(panorama: Image) -> Image:
    """Return the brightness of every pixel, shape (rows, columns)."""
    return np.asarray(cv2.cvtColor(panorama, cv2.COLOR_BGR2GRAY), np.uint8)


@lru_cache(maxsize=8)
def sectors(columns: int) -> Indices:
    """Return the first column of each sector, and the number of all columns."""
    begins: Indices = np.arange(SECTORS + 1) * columns // SECTORS
    return begins


def feet_of(profile: Array, rows: int, mirror: Mirror) -> Indices:
    """Return the row just above the floor's end of each column, of so many rows."""
    share = (mirror.high + np.arctan(profile)) / (mirror.high - mirror.low)
    feet: Indices = np.clip((share * rows).astype(np.int64) - _ABOVE, 0, rows - 1)
    return feet


def sights(panorama: Image, mirror: Mirror, profile: Array) -> Array:
    """Return the sights of a panorama, shape (sectors, 5).

    Args:
        panorama: top row at the mirror's highest elevation.
        mirror: elevations of the panorama's rows.
        profile: inverse distance of the floor's end in each column, see `floor_profile`.
    """
    rows, columns, _ = panorama.shape
    foot, light_of = feet_of(profile, rows, mirror), brightness(panorama)
    arguments = panorama, light_of, foot, sectors(columns)
    if _SIGHTS.pays(*arguments):
        compiled: Array = _SIGHTS(*arguments)
        return compiled
    begins = sectors(columns)[:-1]
    counts = np.maximum(np.diff(begins, append=columns), 1)
    feet = panorama[foot, np.arange(columns)].astype(np.float64)
    colours = np.add.reduceat(feet, begins, axis=0) / counts[:, np.newaxis]
    grey = np.maximum.reduceat(light_of, begins, axis=1)
    row = grey.argmax(axis=0)
    light = grey[row, np.arange(SECTORS)]
    seen: Array = np.column_stack([colours / 255.0, light / 255.0, 1.0 - row / rows])
    return seen
