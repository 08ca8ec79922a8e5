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


def in_playing_time(events: Iterable[Event]) -> Iterator[Event]:
    """Yield events with times that never go back, and on by a minute at most."""
    shift, last = 0, None
    for event in events:
        when = event.received - shift
        if last is not None:
            step = min(max(when - last, 0), LONGEST_SILENCE * 1_000_000_000)
            shift, when = event.received - last - step, last + step
        last = when
        yield event if when == event.received else replace(event, received=when)
