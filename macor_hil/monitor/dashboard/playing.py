"""Playing a recording for a page, at any of its moments, without holding it in memory.

It is read once for its length and for what is marked on the slider. Then every page reads it for
itself while it plays. A leap begins to read a minute before the moment where it leads to, with the
latest event of each kind before that: so the picture of a moment is whole at once, and ways and
curves begin a minute before. A file without an index, or with times that go back, is read from its
beginning.
"""

import time
from bisect import bisect_right
from collections.abc import Callable, Iterator
from math import isnan
from typing import Any, Final, NamedTuple, Protocol, Self

from khepera_protocol.text import printable
from khepera_protocol.zenoh.keys import DECISION, STATE, TRUTH

from macor_hil.monitor.dashboard.wishes import Look
from macor_hil.monitor.robot_state import MarkKind, RobotState
from macor_hil.telemetry.feed import Arrival, Event
from macor_hil.telemetry.recordings.playing_times import PlayingTimes, at, in_playing_time

BEFORE: Final = 60.0
"""Seconds before a moment from which on a leap to it reads."""

AT_ONCE: Final = 2_000
"""Events taken in at once: a fraction of a second."""

_NS: Final = 1e-9
_SECOND: Final = 1_000_000_000

_MOMENTS: Final = 500
"""Collisions and failures of a recording that are marked."""

_KNOTS: Final = 10_000
"""Places where times that are played depart from those that were recorded, at most."""

_LONGEST_NAME: Final = 100


class Read(Protocol):
    """A way of reading a recording, as `play_recording` does."""

    def __call__(self, begin: float, *, tell: bool) -> tuple[str, Iterator[Event]]:
        """Return the robot's name, and events from seconds after the first one on."""
        ...


class Moment(NamedTuple):
    """Something to find again in a recording: seconds since it began, its kind, and words."""

    time: float
    kind: MarkKind
    words: str


class Finder:
    """Finds collisions, touched walls and failures, without reading every sample's JSON."""

    def __init__(self) -> None:
        self.found: list[Moment] = []
        self._touching = self._failing = False

    def look(self, event: Event, when: float) -> None:
        """Look at the next event, so many seconds after the first one."""
        if not isinstance(event, Arrival) or len(self.found) >= _MOMENTS:
            return
        if event.leaf == DECISION.leaf and b'"collided":true' in event.data:
            self.found.append(Moment(when, MarkKind.COLLISION, "collision"))
        elif event.leaf == TRUTH.leaf:
            before, self._touching = self._touching, b'"contact":true' in event.data
            if self._touching and not before:
                what = "the body touched something"
                self.found.append(Moment(when, MarkKind.CONTACT, what))
        elif event.leaf == STATE.leaf:
            phases = (b'"phase":"recovering"', b'"phase":"failed"')
            before, self._failing = self._failing, any(phase in event.data for phase in phases)
            if self._failing and not before:
                self.found.append(Moment(when, MarkKind.FAILURE, "failure"))


class _Knot(NamedTuple):
    """An event from which on times are played with another shift, all in ns."""

    played: int
    recorded: int

    @property
    def shift(self) -> int:
        return self.recorded - self.played


class Timeline:
    """A recording by the times at which it is played (`PlayingTimes`), for all who play it.

    Args:
        read: reads it.
        has_index: whether it can be read from its middle.

    Attributes:
        robot: its name.
        begin: when its first event came, ns.
        duration: seconds from the first event to the last one.
        moments: collisions and failures, for the page's slider.

    Raises:
        RecordingError: it cannot be read.
    """

    def __init__(self, read: Read, *, has_index: bool) -> None:
        self._read = read
        name, events = read(0.0, tell=True)
        self.robot = printable(name, _LONGEST_NAME)
        times, finder = PlayingTimes(), Finder()
        first = next(events)
        self.begin = last = times.of(first.received)
        self._knots = [_Knot(self.begin, first.received)]
        finder.look(first, 0.0)
        latest, back = first.received, False
        for event in events:
            last = times.of(event.received)
            back = back or event.received < latest
            latest = event.received
            if times.shift != self._knots[-1].shift and len(self._knots) <= _KNOTS:
                self._knots.append(_Knot(last, event.received))
            finder.look(event, (last - self.begin) * _NS)
        self._has_index = has_index and not back and len(self._knots) <= _KNOTS
        self.duration = (last - self.begin) * _NS
        told = [[round(each.time, 2), each.kind.value, each.words] for each in finder.found]
        self.moments: dict[str, Any] = {"moments": told}

    def events(self, position: float) -> Iterator[Event]:
        """Read events from seconds after the first one on, or from before that, as they are played.

        Raises:
            RecordingError: it cannot be read any more.
        """
        if position <= 0.0 or not self._has_index:
            return in_playing_time(self._read(0.0, tell=False)[1])
        when = self.begin + round(position * _SECOND)
        place = bisect_right(self._knots, when, key=lambda knot: knot.played) - 1
        recorded = when + self._knots[place].shift - self._knots[0].recorded
        return map(self._as_played, self._read(recorded * _NS, tell=False)[1])

    def _as_played(self, event: Event) -> Event:
        """Return an event of a recording whose times only grow, with the time that it is played."""
        place = bisect_right(self._knots, event.received, key=lambda knot: knot.recorded) - 1
        return at(event, event.received - self._knots[max(place, 0)].shift)


class RecordingSource:
    """A recording, at any of its moments.

    A poll takes in so many events at most, and goes on in the next one.

    Args:
        timeline: the recording; others may play it, too.
        clock: seconds that playing goes by.

    Attributes:
        watched: what was known at the present moment.
        duration: of the recording, seconds.
        playing: whether time passes.
        speed: how many times faster.
        moments: see `Timeline`.
    """

    def __init__(self, timeline: Timeline, clock: Callable[[], float] = time.monotonic) -> None:
        self.playing = True
        self.speed = 1.0
        self.moments = timeline.moments
        self.duration = timeline.duration
        self._timeline = timeline
        self._clock = clock
        self._polled = clock()
        self._position = 0.0
        self.watched = RobotState(timeline.robot)
        self._open(0.0)
        self.seek(0.0)

    @property
    def now(self) -> float:
        """The present moment, on the clock of the arrivals."""
        return self._timeline.begin * _NS + self._position

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
            self._position = min(self._position + passed * self.speed, self.duration)
            self._catch_up()
            self.playing = self._position < self.duration

    def resumed(self, look: Look) -> Self:
        """Return this player where a page was that it has lost its connection to."""
        self.seek(look.position)
        self.playing, self.speed = look.playing, look.speed
        return self

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
        # what lies a little ahead is read on to
        if not 0.0 <= self._position - self._reached <= BEFORE:
            version = self.watched.version
            self.watched = RobotState(self._timeline.robot, version=version + 1)
            self._open(self._position - BEFORE)
        self._catch_up()

    def _open(self, position: float) -> None:
        """Begin to read there."""
        self._events = self._timeline.events(position)
        self._next = next(self._events, None)
        self._reached = 0.0

    def _catch_up(self) -> bool:
        """Take in events up to the present moment, as many as one call may, and return if all."""
        now = self._timeline.begin + round(self._position * _SECOND)
        for _ in range(AT_ONCE):
            if self._next is None or self._next.received > now:
                self._reached = self._position
                return True
            self.watched.take(self._next)
            self._reached = max(0.0, (self._next.received - self._timeline.begin) * _NS)
            self._next = next(self._events, None)
        return False
