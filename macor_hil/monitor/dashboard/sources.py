"""Sources of what the dashboard shows: a live robot, or a recording to scrub through."""

import time
from bisect import bisect_right
from collections.abc import Callable, Sequence
from copy import deepcopy
from math import isnan
from typing import Final, Protocol

from macor_hil.monitor.follower import Follower
from macor_hil.monitor.robot_state import RobotState
from macor_hil.telemetry.feed import Event
from macor_hil.telemetry.recordings.playing_times import in_playing_time

_NS: Final = 1e-9

_AT_ONCE: Final = 2_000
"""Events taken in at once: a fraction of a second."""

_BUSY: Final = 0.05
"""Seconds that taking in may take at once: the page is served by the same thread."""


class Source(Protocol):
    """A source of what is shown."""

    @property
    def watched(self) -> RobotState:
        """The robot as it is known now."""
        ...

    @property
    def now(self) -> float:
        """The time that ages count to, in seconds of the clock of the arrivals."""
        ...

    def poll(self) -> None:
        """Take in what has happened since the last time."""
        ...


class LiveSource:
    """A live robot, as a follower knows it."""

    def __init__(self, follower: Follower) -> None:
        self._follower = follower

    @property
    def watched(self) -> RobotState:
        """The robot as it is known now."""
        return self._follower.watched

    @property
    def now(self) -> float:
        """The clock of the arrivals."""
        return self._follower.now

    def poll(self) -> None:
        """Take in what has come."""
        self._follower.drain(_BUSY)


class RecordingSource:
    """A recording, at any of its moments.

    Seeking is bounded: a poll takes in so many events at most, and goes on in the next one; what
    was known at earlier moments is kept every so often, so that going back need not begin anew.

    Args:
        robot: its name.
        events: what was recorded, in its order; not empty.
        clock: seconds that playing goes by.

    Attributes:
        watched: what was known at the present moment.
        duration: of the recording, seconds.
        playing: whether time passes.
        speed: how many times faster.
    """

    def __init__(
        self,
        robot: str,
        events: Sequence[Event],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.watched = RobotState(robot)
        self.playing = True
        self.speed = 1.0
        self._events = list(in_playing_time(events))
        first = self._events[0].received
        self._times = [(event.received - first) * _NS for event in self._events]
        self.duration = self._times[-1]
        self._clock = clock
        self._polled = clock()
        self._position = 0.0
        self._taken = 0
        self._known = {0: RobotState(robot)}
        self.seek(0.0)

    @property
    def now(self) -> float:
        """The present moment, on the clock of the arrivals."""
        return self._events[0].received * _NS + self._position

    @property
    def position(self) -> float:
        """The present moment, seconds since the recording began."""
        return self._position

    def poll(self) -> None:
        """Let time pass, to the end at most; or take in what a long leap has left."""
        now = self._clock()
        passed, self._polled = now - self._polled, now
        if not self._catch_up():
            return
        if self.playing:
            self.seek(self._position + passed * self.speed)
            self.playing = self._position < self.duration

    def toggle(self) -> None:
        """Play or pause; at the end, from the beginning."""
        if not self.playing and self._position >= self.duration:
            self.seek(0.0)
        self.playing = not self.playing

    def seek(self, position: float) -> None:
        """Go to a moment, in seconds since the recording began; to none that is no number."""
        if isnan(position):
            return
        self._position = min(max(position, 0.0), self.duration)
        wanted = self._wanted()
        known = max(number for number in self._known if number <= wanted)
        if self._taken > wanted or self._taken < known:
            version = self.watched.version
            self.watched = deepcopy(self._known[known])
            self.watched.version = version + 1
            self._taken = known
        self._catch_up()

    def _wanted(self) -> int:
        """Return how many events lie before the present moment."""
        return bisect_right(self._times, self._position)

    def _catch_up(self) -> bool:
        """Take in events up to the present moment, as many as one call may, and return if all."""
        wanted = self._wanted()
        for event in self._events[self._taken : min(wanted, self._taken + _AT_ONCE)]:
            self.watched.take(event)
            self._taken += 1
            if self._taken % _AT_ONCE == 0 and self._taken not in self._known:
                self._known[self._taken] = deepcopy(self.watched)
        return self._taken == wanted
