"""Accelerometer and gyroscope: they feel tilt, starts, stops and bumps, and turns.

The axes are those of the firmware's text: x to the right, y ahead, z up. A robot on a level floor
tilts only where somebody tilts it (`Tilt`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, sin, sqrt
from typing import Final

import numpy as np
from khepera_protocol.epuck.units import GYRO_DIGITS, ZERO_G
from khepera_protocol.serial.units import CONTROL_PERIOD

Axes = tuple[float, float, float]

G: Final = 9.81
_MOST_G: Final = 2.0
"""Greatest acceleration of an axis that the sensor tells, in g (a choice)."""

_NOISE: Final = 0.004
"""Standard deviation of an axis of the accelerometer, in g (a choice)."""

_GYRO_NOISE: Final = 0.1
"""Standard deviation of an axis of the gyroscope, in degrees a second (a choice)."""

_LEVEL: Final = 5.0
_UPSIDE_DOWN: Final = 160.0
"""Inclinations in degrees below and above which the firmware tells no orientation."""


@dataclass(slots=True)
class Tilt:
    """Somebody's hand under the robot: radians nose up, and right side up."""

    pitch: float = 0.0
    roll: float = 0.0


class MotionSense:
    """The two sensors of one robot.

    Args:
        rng: source of their noise.

    Attributes:
        tilt: of the robot.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.tilt = Tilt()
        self._noise = _noise(rng)
        self._speed = self._heading = 0.0
        self._ahead = self._rate = 0.0

    def period(self, speed: float, heading: float) -> None:
        """Take in what the body did in a control period: its speed in m/s, and its heading."""
        self._ahead = (speed - self._speed) / CONTROL_PERIOD
        self._rate = (heading - self._heading) / CONTROL_PERIOD
        self._speed, self._heading = speed, heading

    def put(self, heading: float) -> None:
        """Begin anew at rest."""
        self._speed = self._ahead = self._rate = 0.0
        self._heading = heading

    @property
    def still(self) -> bool:
        """True if nothing is felt but what tilts it."""
        return self._speed == self._ahead == self._rate == 0.0

    def acceleration(self) -> Axes:
        """Feel the acceleration in g: gravity's reaction and what the wheels give."""
        noise = next(self._noise)
        tilt = self.tilt
        lateral = -self._speed * self._rate  # towards the inside of a curve, left positive
        felt = (
            -sin(tilt.roll) + lateral / G,
            sin(tilt.pitch) + self._ahead / G,
            cos(tilt.pitch) * cos(tilt.roll),
        )
        x, y, z = (
            min(max(value + _NOISE * drawn, -_MOST_G), _MOST_G)
            for value, drawn in zip(felt, noise, strict=True)
        )
        return x, y, z

    def turning(self) -> tuple[int, int, int]:
        """Read the gyroscope: 131 digits a degree a second, left turns positive about z."""
        rates = (0.0, 0.0, degrees(self._rate))
        x, y, z = (
            min(max(int(GYRO_DIGITS * (rate + _GYRO_NOISE * drawn)), -32768), 32767)
            for rate, drawn in zip(rates, next(self._noise), strict=True)
        )
        return x, y, z


def digits(felt: Axes, one_g: int) -> tuple[int, int, int]:
    """Return the readings of A: 2048 without acceleration."""
    x, y, z = (min(max(int(ZERO_G + one_g * value), 0), 4095) for value in felt)
    return x, y, z


def spheric(felt: Axes, one_g: int) -> Axes:
    """Return acceleration in digits, orientation and inclination in degrees, as the firmware."""
    x, y, z = (one_g * value for value in felt)
    inclination = 90.0 - degrees(atan2(z, hypot(x, y)))
    level = inclination < _LEVEL or inclination > _UPSIDE_DOWN
    orientation = 0.0 if level else degrees(atan2(x, y)) + 180.0
    return sqrt(x * x + y * y + z * z), orientation, inclination


def _noise(rng: np.random.Generator, block: int = 64) -> Iterator[list[float]]:
    while True:
        yield from rng.standard_normal((block, 3)).tolist()
