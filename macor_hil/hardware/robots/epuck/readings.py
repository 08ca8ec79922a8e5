"""An e-puck's numbers in the driver's units: infrared readings, counters that wrap, the battery."""

from typing import Final

import numpy as np
from khepera_protocol.epuck.letters import wrapped
from khepera_protocol.epuck.units import SENSOR_BEARINGS, battery_volts

from macor_hil.arrays import Image
from macor_hil.hardware.robots.form import SATURATED

_ORDER: Final = (5, 6, 7, 0, 1, 2, 3, 4)
"""An e-puck's sensors from the left over the front to the back right and left."""

BEARINGS: Final = tuple(SENSOR_BEARINGS[k] for k in _ORDER)
"""Of the sensors in the driver's order, degrees."""

NEAR: Final = 600
"""Reading before a white wall at 15 mm, at which a Khepera's sensor is saturated."""

_FULL: Final = 1023

_EMPTY, _CHARGED = (2070, 3.4), (2560, 4.2)
"""Readings of an e-puck's battery, hardware 1.3, and the volts that they stand for."""


def scaled(raw: int) -> int:
    """Return an infrared reading in the driver's scale."""
    return min(raw * SATURATED // NEAR, _FULL)


def proximity_of(raw: tuple[int, ...]) -> tuple[int, ...]:
    """Return the eight infrared readings in the driver's scale and order."""
    return tuple([min(raw[k] * SATURATED // NEAR, _FULL) for k in _ORDER])


def volts_of(raw: int, *, second: bool) -> float | None:
    """Return the battery's voltage; None where only its being good is told.

    Args:
        raw: reading of b.
        second: whether it is an e-puck2's.
    """
    if raw <= 1:
        return None
    if second:
        return battery_volts(raw)
    (low, least), (high, most) = _EMPTY, _CHARGED
    return least + (raw - low) * (most - least) / (high - low)


def image_of(pixels: bytes, width: int, height: int) -> Image:
    """Return a picture of RGB565, high byte first, as blue, green and red, shape (H, W, 3)."""
    words = np.frombuffer(pixels, ">u2").reshape(height, width).astype(np.uint16)
    parts = (words & 31) << 3, (words >> 5 & 63) << 2, (words >> 11) << 3
    return np.stack(parts, axis=-1).astype(np.uint8)


class Counting:
    """Step counters of which only 16 bits are told, counted on."""

    def __init__(self) -> None:
        self._raw: tuple[int, ...] | None = None
        self._whole = [0, 0]

    def take(self, raw: tuple[int, ...]) -> tuple[int, int]:
        """Return both counters without wraps."""
        before = raw if self._raw is None else self._raw
        if self._raw is None:
            self._whole = list(raw)
        for k, (new, old) in enumerate(zip(raw, before, strict=True)):
            self._whole[k] += wrapped(new - old, 16)
        self._raw = raw
        left, right = self._whole
        return left, right
