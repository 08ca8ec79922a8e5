"""Times at which the events of a recording are played: with the pauses they had, within limits.

A recording made while the wall clock was set has times that go back, or on by a year; nobody wants
to wait for a silence of hours either.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Final

from macor_hil.telemetry.feed import Event

LONGEST_SILENCE: Final = 60
"""Seconds between two events at most."""


class PlayingTimes:
    """Times that never go back, and on by a minute at most.

    Attributes:
        shift: recorded times are so many ns later than those at which they are played.
    """

    def __init__(self) -> None:
        self.shift = 0
        self._last: int | None = None

    def of(self, received: int) -> int:
        """Return when the next event is played, ns."""
        when = received - self.shift
        if self._last is not None:
            step = min(max(when - self._last, 0), LONGEST_SILENCE * 1_000_000_000)
            when = self._last + step
            self.shift = received - when
        self._last = when
        return when


def in_playing_time(events: Iterable[Event]) -> Iterator[Event]:
    """Yield events with the times at which they are played."""
    times = PlayingTimes()
    for event in events:
        yield at(event, times.of(event.received))


def at(event: Event, when: int) -> Event:
    """Return an event with another time of its arrival, ns."""
    return event if when == event.received else replace(event, received=when)
