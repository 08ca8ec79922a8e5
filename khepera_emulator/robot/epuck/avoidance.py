"""The e-puck2's own avoidance of obstacles: a force field of the infrared sensors, at 50 Hz.

Source: the firmware's `behaviors.c`, weights and shifts included.
"""

from collections.abc import Sequence
from typing import Final

_NOISE: Final = 5
"""Readings below it count as 0."""


def avoid(wanted: Sequence[int], proximity: Sequence[int]) -> tuple[int, int]:
    """Return speeds in steps a second for the motors.

    Args:
        wanted: speeds that the client wants, left and right.
        proximity: the eight readings.
    """
    p = [count if count >= _NOISE else 0 for count in proximity]
    push = -p[0] - (p[1] >> 1) + (p[3] - (p[3] >> 2)) + (p[4] - (p[4] >> 2)) - (p[6] >> 1) - p[7]
    turn = (p[0] >> 1) + (p[1] >> 1) + p[2] + (p[3] >> 1)
    turn -= (p[4] >> 1) + p[5] + (p[6] >> 1) + (p[7] >> 1)
    left, right = wanted
    back, aside = push >> 1, turn << 2
    left += back - aside if left >= 0 else -(back + aside)
    right += back + aside if right >= 0 else -(back - aside)
    return left, right
