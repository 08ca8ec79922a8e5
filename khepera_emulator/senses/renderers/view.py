"""The interface of a renderer, and the light that all of them draw by."""

from math import hypot
from typing import Protocol

import numpy as np
from khepera_protocol.zenoh.payloads import Pose
from numpy.typing import NDArray

Image = NDArray[np.uint8]
"""Picture of shape (height, width, 3), channels in OpenCV's order blue, green, red."""

Grid = NDArray[np.float64]
"""A value for each pixel of a picture."""

LIGHT = (0.3, 0.5, 1.0)
"""Direction that the light comes from."""

AMBIENT, DIFFUSE = 0.7, 0.3

FLOOR_SHADE = AMBIENT + DIFFUSE * LIGHT[2] / hypot(*LIGHT)
"""Brightness of a level floor."""


class Renderer(Protocol):
    """Painter of all that is around a point, into one picture, its atlas."""

    def render(self, pose: Pose) -> Image:
        """Return the atlas as seen by a camera on a robot at a pose."""

    def place(self, azimuth: Grid, elevation: Grid) -> tuple[Grid, Grid]:
        """Find where in the atlas directions lie.

        Args:
            azimuth: radians to the left of straight ahead.
            elevation: radians above the horizon.

        Returns:
            Column and row, with their fractions.
        """


def floor_colour(share: tuple[float, float, float]) -> list[int]:
    """Return blue, green and red of a lit floor, as PyBullet makes them: a byte, then again."""
    return [int(int(255 * part) * FLOOR_SHADE) for part in reversed(share)]


def sky_colour(share: tuple[float, float, float]) -> list[int]:
    """Return blue, green and red of the sky, which needs no light."""
    return [round(255 * part) for part in reversed(share)]
