"""Stepper motors: they step at the pace they are told, whatever becomes of the wheels.

A timer makes the steps, so that speeds are those whose period is a whole number of its ticks; the
counter counts what was commanded, and goes on at a wall.
"""

from dataclasses import dataclass
from math import copysign, floor
from typing import Final

from khepera_protocol.epuck.letters import wrapped

_ROUNDING: Final = 1e-6
"""Steps by which a sum of parts of steps may miss a whole number."""

_TENTHS, _HUNDREDTHS = 10_000, 100_000
"""Ticks a second of the e-puck's timer and of the e-puck2's."""


def real_speed(speed: int, *, fast_timer: bool) -> float:
    """Return the steps a second that a motor makes when it is told a speed within its limits.

    Args:
        speed: steps a second.
        fast_timer: whether it is an e-puck2's, which makes two microsteps for a step.
    """
    if speed == 0:
        return 0.0
    if fast_timer:
        pace = _HUNDREDTHS / (2 * (_HUNDREDTHS // (2 * abs(speed))))
    else:
        pace = _TENTHS / (_TENTHS // abs(speed))
    return copysign(pace, speed)


@dataclass(slots=True)
class Stepper:
    """A wheel's motor.

    Attributes:
        limit: greatest speed, in steps a second.
        bits: of the counter.
        fast_timer: see `real_speed`.
        speed: that it was told, within the limit.
        pace: steps a second that it makes.
        travel: steps since power-on, with their fraction.
        offset: what P added to the counter.
    """

    limit: int
    bits: int
    fast_timer: bool
    speed: int = 0
    pace: float = 0.0
    travel: float = 0.0
    offset: int = 0

    def drive(self, speed: int) -> None:
        """Turn at a speed; one beyond the limit is the limit."""
        self.speed = min(max(speed, -self.limit), self.limit)
        self.pace = real_speed(self.speed, fast_timer=self.fast_timer)

    def step(self, seconds: float) -> float:
        """Let time pass; returns the steps made meanwhile, with their fraction."""
        way = self.pace * seconds
        self.travel += way
        return way

    @property
    def counter(self) -> int:
        """Step counter, a signed number that wraps."""
        return wrapped(floor(self.travel + _ROUNDING) + self.offset, self.bits)

    @counter.setter
    def counter(self, value: int) -> None:
        self.offset = value - floor(self.travel + _ROUNDING)
