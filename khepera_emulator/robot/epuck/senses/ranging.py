"""Time of flight: the distance to the nearest thing ahead, ten times a second."""

from math import inf

import numpy as np

from khepera_emulator.world.floor_plan import Scene

PERIOD = 0.1
"""Seconds between two measurements."""

FIELD = np.radians(25.0)
"""Of view."""

NOTHING = 8190
"""Reading in mm without an echo (the sensor's own mark)."""

_RAYS = np.linspace(-FIELD / 2, FIELD / 2, 9)
_MOST = 2.0
"""Metres of the greatest distance."""

_NOISE = 0.02
_FOOT = 0.033
"""Metres from the robot's middle to the sensor (a choice)."""


def measure(scene: Scene, x: float, y: float, heading: float, rng: np.random.Generator) -> int:
    """Measure from a robot's place, in mm."""
    angles = heading + _RAYS
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    foot = np.array([x + _FOOT * np.cos(heading), y + _FOOT * np.sin(heading)])
    distances, _ = scene.cast(np.tile(foot, (len(rays), 1)), rays)
    nearest = float(distances.min(initial=inf))
    noise = float(rng.standard_normal())
    if nearest > _MOST:
        return NOTHING
    return max(round(1000.0 * nearest * (1.0 + _NOISE * noise)), 0)
