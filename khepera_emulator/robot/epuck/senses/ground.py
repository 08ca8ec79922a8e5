"""The board of ground sensors: three look at the floor ahead, two aside of them for cliffs."""

from math import cos, sin

import numpy as np

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.world.floor import floor_grey

PLACES = ((0.030, 0.009), (0.030, 0.0), (0.030, -0.009), (0.028, 0.020), (0.028, -0.020))
"""Metres ahead and to the left of the robot's middle: left, middle, right; left and right cliff
sensor (a choice)."""

_BLACK, _WHITE = 150.0, 950.0
"""Readings over a black and over a white floor (a choice); they have ten bits."""

_NOISE = 4.0
_MOST = 1023
AMBIENT = 60
"""Reading of ambient light under the robot (a choice)."""


def read(
    arena: Arena, x: float, y: float, heading: float, rng: np.random.Generator
) -> tuple[int, ...]:
    """Read all five at a robot's place."""
    c, s = cos(heading), sin(heading)
    values = []
    for (ahead, left), noise in zip(PLACES, rng.standard_normal(len(PLACES)).tolist(), strict=True):
        grey = floor_grey(arena, x + c * ahead - s * left, y + s * ahead + c * left)
        value = _BLACK + (_WHITE - _BLACK) * grey + _NOISE * noise
        values.append(int(min(max(value, 0.0), _MOST)))
    return tuple(values)
