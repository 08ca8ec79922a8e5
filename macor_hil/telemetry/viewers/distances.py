"""Distances that infrared readings stand for, to draw them and to tell them in metres.

A reading depends on colour, angle and sensor; sensors differ by 5 mm and more. What is here is the
mean of the eight sensors of one Khepera before a white wall (S. Nolfi's samples, the median within
6 degrees of each sensor's axis): a robot that plans by it wants a measurement of its own.
"""

from typing import Final

import numpy as np

_READINGS: Final = (3, 12, 26, 30, 55, 97, 161, 233, 271, 449, 631, 782, 914, 993, 1023)
_GAPS: Final = (43, 41, 39, 37, 35, 33, 31, 29, 27, 25, 23, 21, 19, 17, 15)
"""Counts, and the millimetres between wall and body that give them."""

NEAREST: Final = 0.015
"""Metres at which the sensors are saturated."""

FARTHEST: Final = 0.043
"""Metres from which on nothing is seen."""

FIELD_OF_VIEW: Final = 0.52
"""Radians that a sensor sees at half of its reading (samples above: 30 degrees)."""


def distance(reading: int) -> float | None:
    """Return the metres between the body and a white wall for a reading; None: nothing is seen."""
    if reading < _READINGS[0]:
        return None
    return float(np.interp(reading, _READINGS, _GAPS)) / 1000
