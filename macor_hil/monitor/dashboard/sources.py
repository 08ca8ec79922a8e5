"""Where the dashboard's picture comes from: a live robot, or a recording to scrub through."""

import time
from collections.abc import Callable, Sequence
from typing import Final, Protocol

from macor_hil.monitor.watched import Watched
from macor_hil.monitor.watcher import Watcher
from macor_hil.telemetry.feed import Event

_NS: Final = 1e-9


class Source(Protocol):
    """Something to be shown."""

    @property
    def watched(self) -> Watched:
        """What is known now."""
        ...

    @property
    def now(self) -> float:
        """The time that ages count to, in seconds of the clock of the arrivals."""
        ...

    def poll(self) -> None:
        """Take in what has happened since the last time."""
        ...


class Live:
    """What a watcher hears."""

    def __init__(self, watcher: Watcher) -> None:
        self._watcher = watcher

    @property
    def watched(self) -> Watched:
        """What is known now."""
        return self._watcher.watched

    @property
    def now(self) -> float:
        """The wall clock."""
        return time.time()

    def poll(self) -> None:
        """Take in what has come."""
        self._watcher.drain()


class Player:
    """A recording, at any of its moments.

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
        self.watched = Watched(robot)
        self.playing = True
        self.speed = 1.0
        self._events = events
        self._times = [(event.received - events[0].received) * _NS for event in events]
        self.duration = self._times[-1]
        self._clock = clock
        self._polled = clock()
        self._position = 0.0
        self._taken = 0
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
        """Let time pass, to the end at most."""
        now = self._clock()
        passed, self._polled = now - self._polled, now
        if self.playing:
            self.seek(self._position + passed * self.speed)
            self.playing = self._position < self.duration

    def toggle(self) -> None:
        """Play or pause; at the end, from the beginning."""
        if not self.playing and self._position >= self.duration:
            self.seek(0.0)
        self.playing = not self.playing

    def seek(self, position: float) -> None:
        """Go to a moment, in seconds since the recording began."""
        position = min(max(position, 0.0), self.duration)
        if position < self._position:
            version = self.watched.version
            self.watched = Watched(self.watched.robot, version=version + 1)
            self._taken = 0
        self._position = position
        while self._taken < len(self._times) and self._times[self._taken] <= position:
            self.watched.take(self._events[self._taken])
            self._taken += 1
