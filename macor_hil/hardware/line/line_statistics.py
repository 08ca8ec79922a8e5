"""Counts what passes between a client and its robot, for those who watch the line."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

BOUNDS: Final = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""Seconds between which durations are counted: of an exchange, of a plan, of a command."""


class Durations:
    """Counts durations by their length, as a histogram.

    Attributes:
        bounds: seconds, the longest that is still counted in each class but the last one.
        counts: how many there were in each class.
        sum: of all of them, seconds.
    """

    def __init__(self, bounds: Sequence[float] = BOUNDS) -> None:
        self.bounds = bounds
        self.counts = [0] * (len(bounds) + 1)
        self.sum = 0.0

    def add(self, seconds: float) -> None:
        """Count one."""
        self.counts[bisect_left(self.bounds, seconds)] += 1
        self.sum += seconds


@dataclass(frozen=True, slots=True)
class Reading:
    """Counts of a meter.

    Attributes:
        exchanges, failures: requests that were answered and that were not, so far.
        recent: requests answered since the last reading.
        mean, worst: of their round trips, seconds; 0 without any.
    """

    exchanges: int
    failures: int
    recent: int
    mean: float
    worst: float


class Meter:
    """Counts exchanges and times their round trips.

    Attributes:
        exchanges, failures: requests that were answered and that were not, so far.
        times: of their round trips.
    """

    def __init__(self) -> None:
        self.exchanges = 0
        self.failures = 0
        self.times = Durations()
        self._recent = 0
        self._sum = 0.0
        self._worst = 0.0

    def answered(self, seconds: float) -> None:
        """Count a request that was answered after a time."""
        self.exchanges += 1
        self._recent += 1
        self._sum += seconds
        self.times.add(seconds)
        if seconds > self._worst:
            self._worst = seconds

    def watched(self, requests: int, seconds: float, longest: float) -> None:
        """Count requests that were answered one after the other, in so many seconds in all."""
        self.exchanges += requests
        self._recent += requests
        self._sum += seconds
        self._worst = max(self._worst, longest)

    def failed(self) -> None:
        """Count a request that was not answered, or not as a Khepera does."""
        self.failures += 1

    def read(self) -> Reading:
        """Return the counts; those of the recent past begin anew."""
        recent, mean = self._recent, self._sum / max(1, self._recent)
        reading = Reading(self.exchanges, self.failures, recent, mean, self._worst)
        self._recent, self._sum, self._worst = 0, 0.0, 0.0
        return reading
