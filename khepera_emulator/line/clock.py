"""The robot's clock for a robot that lives in real time, or a number of times faster."""

import time
from collections.abc import Callable
from typing import Final

GRID: Final = 2.0**-30
"""Seconds between two moments that a robot's line tells apart: about a nanosecond."""


def on_grid(seconds: float) -> float:
    """Return the nearest multiple of `GRID`."""
    return round(seconds / GRID) * GRID


WRITE_TIME: Final = on_grid(1e-3)
"""Seconds that a write takes a client in this process on a line without wire time: otherwise time
would stand still for a program that asks and waits for the answer, and asks again."""


class Clock:
    """Seconds of simulated time since the clock was made.

    Args:
        speed: simulated seconds in a real one.
        source: a clock that never goes back, in real seconds.
    """

    def __init__(self, speed: float = 1.0, source: Callable[[], float] = time.monotonic) -> None:
        self.speed = speed
        self._source = source
        self._start = source()

    @property
    def now(self) -> float:
        """Simulated seconds."""
        return (self._source() - self._start) * self.speed

    def delay(self, moment: float) -> float:
        """Return real seconds until a moment of simulated time; 0 when it has passed."""
        return max(0.0, (moment - self.now) / self.speed)

    def fall_back(self, seconds: float) -> None:
        """Stand still for so many simulated seconds, as if they had not passed."""
        self._start += seconds / self.speed
