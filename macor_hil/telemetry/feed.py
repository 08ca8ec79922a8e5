"""All published data of a robot as one stream of events; for monitors and recorders.

Zenoh calls back in threads of its own; they only put what came into an inbox, which is bounded.
Everything else happens in the thread that takes the events.
"""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Final, Self

import zenoh
from khepera_protocol.text import printable
from khepera_protocol.zenoh.keys import (
    ALIVE,
    ARENA,
    CAMERA,
    CONTROLLER,
    DECISION,
    EMULATOR,
    KEYS,
    LINK,
    MAP,
    STATE,
    TRUTH,
    Key,
)
from khepera_protocol.zenoh.payload_model import PayloadError
from khepera_protocol.zenoh.payloads import Stamp
from khepera_protocol.zenoh.sample_checks import check_sample, size_of, stamp_of

from macor_hil.telemetry.inbox import Inbox
from macor_hil.telemetry.session import check_robot_name
from macor_hil.telemetry.steady_clock import SteadyClock

_QUERY_PATIENCE: Final = 2.0
"""Seconds that the answer to a query for the latest sample may take."""

_QUERIED: Final = {
    EMULATOR: (ARENA, TRUTH),
    CONTROLLER: (MAP, STATE, DECISION, LINK),
}
"""The keys that a side is queried for when it appears, in this order."""


@dataclass(frozen=True, slots=True)
class Presence:
    """The appearance of a side, or its end, at a time of the wall clock (ns)."""

    side: str
    alive: bool
    received: int


@dataclass(frozen=True, slots=True)
class Arrival:
    """The arrival of a sample.

    Attributes:
        side, leaf: first and last part of its key.
        data: its payload.
        encoding: of the payload.
        stamp: its number and time; None if it has none.
        received: when, on the wall clock of this machine, in ns; see `SteadyClock`.
        live: whether it was published now; otherwise it answers what was asked for.
    """

    side: str
    leaf: str
    data: bytes
    encoding: str
    stamp: Stamp | None
    received: int
    live: bool = True


@dataclass(frozen=True, slots=True)
class Refusal:
    """A sample that was refused: the leaf of its key, the reason, and the time (ns)."""

    leaf: str
    reason: str
    received: int


@dataclass(frozen=True, slots=True)
class Loss:
    """A number of samples, until a time (ns), that came faster than they were taken."""

    count: int
    received: int


@dataclass
class NotTaken:
    """Counts of samples that were not taken.

    Attributes:
        refused: samples that were none of a robot's, or could not be read.
        lost: samples that came faster than they were taken.
        last: what was refused last, and why; empty when nothing was.
    """

    refused: int = 0
    lost: int = 0
    last: str = ""

    def count(self, what: Refusal | Loss) -> None:
        """Count a sample that was refused, or some that were lost."""
        if isinstance(what, Loss):
            self.lost += what.count
        else:
            self.refused += 1
            self.last = printable(f"the last one of {what.leaf}: {what.reason}", 300)

    def words(self) -> str:
        """Return the counts and the last reason; empty when all was taken."""
        counts = (self.refused, "refused"), (self.lost, "lost, they came too fast")
        parts = [f"{count} {what}" for count, what in counts if count]
        return "; ".join(filter(None, [", ".join(parts), self.last]))


Event = Presence | Arrival
"""An event of a robot; recordings hold nothing else."""

Heard = Event | Refusal | Loss
"""An event, or a sample that was not taken."""


class Feed:
    """A subscriber of all keys of one robot; use as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: the robot's name in the keys.
        camera: see `look`.

    Attributes:
        clock: of the times that events carry.

    Raises:
        TelemetryError: the name cannot be part of a key.
    """

    def __init__(self, session: zenoh.Session, robot: str, *, camera: bool = False) -> None:
        check_robot_name(robot)
        self.clock = SteadyClock()
        self._session = session
        self._robot = robot
        self._inbox: Inbox[Callable[[], Heard | None]] = Inbox()
        self._newest: dict[Key, zenoh.Timestamp] = {}
        self._answered: dict[Key, tuple[zenoh.Timestamp, int]] = {}
        self._unanswered: dict[str, set[Key]] = {}
        self._alive: set[str] = set()
        self._looking = camera
        self._camera = ExitStack()
        self._camera_on = False
        with ExitStack() as stack:
            for key in KEYS:
                # the arena is asked for, but a recording that is played tells it later
                if (key.published or key == ARENA) and key != CAMERA:
                    stack.enter_context(self._subscriber(key))
            for side in _QUERIED:
                token = session.liveliness().declare_subscriber(
                    ALIVE[side].of(robot), self._meeting(side), history=True
                )
                stack.enter_context(token)
            stack.callback(self._camera.close)
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def get(self, timeout: float) -> Heard | None:
        """Return the next event; None when there is none for so many seconds."""
        end = time.monotonic() + timeout
        while True:
            if lost := self._inbox.take_losses():
                return Loss(lost, self.clock())
            take = self._inbox.get(max(0.0, end - time.monotonic()))
            if take is None:
                return None
            event = take()
            if event is not None:
                return event

    def look(self, on: bool) -> None:
        """Subscribe to the emulator's own pictures, or no longer.

        They come while there is no controller that tells what it sees, and cost the emulator a
        picture ten times a second.
        """
        if on != self._looking:
            self._looking = on
            self._choose_camera()

    def introduced(self, side: str) -> bool:
        """Return whether a side has been there and has answered what it was asked for."""
        return self._unanswered.get(side) == set()

    def _choose_camera(self) -> None:
        wanted = self._looking and self._alive == {EMULATOR}
        if wanted == self._camera_on:
            return
        self._camera_on = wanted
        if wanted:
            self._camera.enter_context(self._subscriber(CAMERA))
        else:
            self._camera.close()

    def _subscriber(self, key: Key) -> "zenoh.Subscriber[None]":
        def enqueue(sample: zenoh.Sample) -> None:
            received = self.clock()
            self._inbox.put(partial(self._take, key, sample, received), size_of(sample))

        return self._session.declare_subscriber(key.of(self._robot), enqueue)

    def _meeting(self, side: str) -> Callable[[zenoh.Sample], None]:
        def enqueue(token: zenoh.Sample) -> None:
            received = self.clock()
            self._inbox.notify(partial(self._meet, side, token, received))

        return enqueue

    def _meet(self, side: str, token: zenoh.Sample, received: int) -> Heard:
        try:
            check_sample(token, ALIVE[side].of(self._robot), 0)
        except PayloadError as error:
            return Refusal(ALIVE[side].leaf, str(error), received)
        if token.kind == zenoh.SampleKind.DELETE:
            self._alive.discard(side)
            self._choose_camera()
            return Presence(side, False, received)
        self._alive.add(side)
        self._choose_camera()
        unanswered = self._unanswered[side] = set(_QUERIED[side])
        for key in _QUERIED[side]:
            self._newest.pop(key, None)
            self._answered.pop(key, None)
            self._ask(key, unanswered)
        return Presence(side, True, received)

    def _ask(self, key: Key, unanswered: set[Key]) -> None:
        def enqueue(reply: zenoh.Reply) -> None:
            received, sample = self.clock(), reply.ok
            if sample is not None:  # otherwise there is nothing to tell yet
                take = partial(self._take, key, sample, received, live=False)
                self._inbox.put(take, size_of(sample))

        def end() -> None:
            self._inbox.notify(lambda: unanswered.discard(key))

        answers = zenoh.handlers.Callback(enqueue, end)
        self._session.get(key.of(self._robot), answers, timeout=_QUERY_PATIENCE)

    def _take(
        self, key: Key, sample: zenoh.Sample, received: int, *, live: bool = True
    ) -> Heard | None:
        """Return what came, unless it is known already or older than what is known."""
        try:
            check_sample(sample, key.of(self._robot), key.limit)
            stamp = stamp_of(sample)
        except PayloadError as error:
            return Refusal(key.leaf, str(error), received)
        if sample.timestamp is not None and self._is_known(key, sample.timestamp, received, live):
            return None
        data, encoding = sample.payload.to_bytes(), str(sample.encoding)
        return Arrival(key.side, key.leaf, data, encoding, stamp, received, live)

    def _is_known(self, key: Key, timestamp: zenoh.Timestamp, received: int, live: bool) -> bool:
        """Return whether a sample is no news, and remember it.

        An answer may overtake what was published before it, and may come after what was published
        since. Later on, time stamps are nobody's business: one of the far future, from whoever it
        is, must not make all that follow it old.
        """
        newest = self._newest.get(key)
        if not live:
            self._answered[key] = timestamp, received
            return newest is not None and newest >= timestamp
        answer, when = self._answered.get(key, (timestamp, 0))
        self._newest[key] = timestamp
        overtaken = received - when < _QUERY_PATIENCE * 1e9 and timestamp <= answer
        return overtaken or newest == timestamp
