"""Sources of what the dashboard shows: live robots, or a recording to scrub through."""

import time
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import deepcopy
from math import isnan
from typing import Any, Final, NamedTuple, Protocol, Self

from khepera_protocol.zenoh.keys import DECISION, STATE, TRUTH

from macor_hil.monitor.dashboard.board import Board, Parts
from macor_hil.monitor.dashboard.wishes import Look
from macor_hil.monitor.follower import Follower
from macor_hil.monitor.robot_state import MarkKind, RobotState
from macor_hil.monitor.roster import Roster
from macor_hil.telemetry.feed import Arrival, Event
from macor_hil.telemetry.recordings.playing_times import in_playing_time

_NS: Final = 1e-9

_AT_ONCE: Final = 2_000
"""Events taken in at once: a fraction of a second."""

_BUSY: Final = 0.05
"""Seconds that taking in may take at once: the pages are served by the same thread."""

_LOOKED_AT: Final = 20
"""Polls without a look after which a robot's own camera is left alone again."""

_NOBODY: Final = "khepera"
"""Name on the page while there is no robot."""

_MOMENTS: Final = 500
"""Collisions and failures of a recording that are marked."""


class Shown(NamedTuple):
    """A robot's page at a moment: its parts, and its latest picture."""

    parts: Parts
    picture: bytes


class Live:
    """Live robots, as followers know them, with a board for each.

    Args:
        roster: the robots.
    """

    def __init__(self, roster: Roster) -> None:
        self._roster = roster
        self._boards: dict[str, Board] = {}
        self._shown: dict[str, Shown] = {}
        self._looked: dict[str, int] = {}
        self._turn = 0

    def poll(self) -> None:
        """Take in what has come; called again and again, whether anyone looks or not."""
        self._roster.drain(_BUSY)
        self._turn += 1
        self._shown.clear()
        for name, follower in self._roster.robots.items():
            follower.feed.look(self._turn - self._looked.get(name, -_LOOKED_AT) < _LOOKED_AT)

    def choose(self, name: str) -> str:
        """Return a robot's name if it is known, else that of one who is there."""
        robots = self._roster.robots
        if name in robots:
            return name
        there = (each for each, follower in robots.items() if follower.watched.alive)
        return next(there, next(iter(robots), ""))

    def show(self, name: str) -> Shown:
        """Return a robot's page as of the last poll; computed once for all who look."""
        known = self._shown.get(name)
        if known is None:
            self._looked[name] = self._turn
            robots = {each: follower.watched for each, follower in self._roster.robots.items()}
            watched = robots.get(name) or RobotState(_NOBODY)
            board = self._boards.setdefault(name, Board())
            parts = board.parts(watched, robots, self._now())
            known = self._shown[name] = Shown(parts, board.picture)
        return known

    def _now(self) -> float:
        follower: Follower | None = next(iter(self._roster.robots.values()), None)
        return follower.now if follower else 0.0


class View(Protocol):
    """Something that one browser looks at."""

    robot: str

    def show(self) -> Shown:
        """Return the page as of now."""
        ...


class LiveView:
    """One browser's look at live robots.

    Attributes:
        robot: the one that was chosen; empty: none is there.
    """

    def __init__(self, live: Live, robot: str) -> None:
        self.robot = robot
        self._live = live

    def show(self) -> Shown:
        """Return the page as of now."""
        self.robot = self._live.choose(self.robot)
        return self._live.show(self.robot)


class RecordingView:
    """One browser's look at a recording, which it plays for itself.

    Attributes:
        robot: that was recorded.
        player: plays it.
    """

    def __init__(self, player: "RecordingSource") -> None:
        self.player = player
        self.robot = player.watched.robot
        self._board = Board()

    def show(self) -> Shown:
        """Let time pass, and return the page as of now."""
        player = self.player
        player.poll()
        parts = self._board.parts(player.watched, {self.robot: player.watched}, player.now)
        parts["player"] = {
            "position": round(player.position, 2),
            "duration": round(player.duration, 2),
            "playing": player.playing,
            "speed": player.speed,
        }
        parts["moments"] = player.moments
        return Shown(parts, self._board.picture)


class Moment(NamedTuple):
    """Something to find again in a recording: seconds since it began, its kind, and words."""

    time: float
    kind: MarkKind
    words: str


def moments_of(events: Sequence[Event]) -> Iterator[Moment]:
    """Find collisions, touched walls and failures, without reading every sample's JSON."""
    begin = events[0].received
    touching = failing = False
    for event in events:
        if not isinstance(event, Arrival):
            continue
        when = (event.received - begin) * _NS
        if event.leaf == DECISION.leaf and b'"collided":true' in event.data:
            yield Moment(when, MarkKind.COLLISION, "collision")
        elif event.leaf == TRUTH.leaf:
            before, touching = touching, b'"contact":true' in event.data
            if touching and not before:
                yield Moment(when, MarkKind.CONTACT, "the body touched something")
        elif event.leaf == STATE.leaf:
            phases = (b'"phase":"recovering"', b'"phase":"failed"')
            before, failing = failing, any(phase in event.data for phase in phases)
            if failing and not before:
                yield Moment(when, MarkKind.FAILURE, "failure")


class Timeline:
    """A recording by the times that it is played at (`in_playing_time`), for all who play it.

    Args:
        robot: its name.
        events: what was recorded, in its order; not empty.

    Attributes:
        robot: its name.
        events: with those times.
        times: seconds since the first one, of each.
        moments: collisions and failures, for the page's slider.
    """

    def __init__(self, robot: str, events: Iterable[Event]) -> None:
        self.robot = robot
        self.events = list(in_playing_time(events))
        first = self.events[0].received
        self.times = [(event.received - first) * _NS for event in self.events]
        found = list(moments_of(self.events))[:_MOMENTS]
        told = [[round(each.time, 2), each.kind.value, each.words] for each in found]
        self.moments: dict[str, Any] = {"moments": told}


class RecordingSource:
    """A recording, at any of its moments.

    Seeking is bounded: a poll takes in so many events at most, and goes on in the next one; what
    was known at earlier moments is kept every so often, so that going back need not begin anew.

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
        self.watched = RobotState(timeline.robot)
        self.playing = True
        self.speed = 1.0
        self.moments = timeline.moments
        self._events, self._times = timeline.events, timeline.times
        self.duration = self._times[-1]
        self._clock = clock
        self._polled = clock()
        self._position = 0.0
        self._taken = 0
        self._known = {0: RobotState(timeline.robot)}
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
