"""Everything that is told of a robot, as one stream of events; for monitors and recorders.

Zenoh calls back in threads of its own; they only put what came on a queue. Everything else
happens in the thread that takes the events.
"""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Final, Self

import zenoh
from pydantic import ValidationError

from macor_hil.telemetry.keys import ALIVE, KEYS
from macor_hil.telemetry.session import check_robot_name
from protocol.keys import CONTROLLER, EMULATOR
from protocol.side_channel import Stamp

CAMERA: Final = "camera"
"""The emulator's own picture stream."""

_QUERY_PATIENCE: Final = 2.0
"""Seconds that the answer to a query for the latest sample may take."""

_QUERIED: Final = {
    EMULATOR: ("arena", "truth"),
    CONTROLLER: ("map", "state", "decision", "link"),
}
"""What to ask whoever appears for, in this order."""


@dataclass(frozen=True, slots=True)
class Presence:
    """Emulator or controller (the side) has appeared, or gone, at a time of the wall clock (ns)."""

    side: str
    alive: bool
    received: int


@dataclass(frozen=True, slots=True)
class Arrival:
    """A sample has come.

    Attributes:
        side, leaf: first and last part of its key.
        data: its payload.
        encoding: of the payload.
        stamp: its number and time; None if it has none that can be read.
        received: when, on the wall clock of this machine, in ns.
        live: whether it was published now; otherwise it answers what was asked for.
    """

    side: str
    leaf: str
    data: bytes
    encoding: str
    stamp: Stamp | None
    received: int
    live: bool = True


Event = Presence | Arrival


class Feed:
    """Follows one robot; use as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: the robot's name in the keys.
        camera: subscribe to the emulator's own picture stream, too, while there is no controller
            that tells what it sees. It costs the emulator a picture ten times a second.

    Raises:
        TelemetryError: the name cannot be part of a key.
    """

    def __init__(self, session: zenoh.Session, robot: str, *, camera: bool = False) -> None:
        check_robot_name(robot)
        self._session = session
        self._robot = robot
        self._queue: SimpleQueue[Callable[[], Event | None]] = SimpleQueue()
        self._newest: dict[str, zenoh.Timestamp] = {}
        self._unanswered: dict[str, int] = {}
        self._alive: set[str] = set()
        self._camera: ExitStack | None = ExitStack() if camera else None
        self._camera_on = False
        with ExitStack() as stack:
            for key in KEYS:
                if key.published and key.leaf != CAMERA:
                    stack.enter_context(self._subscriber(f"{key.side}/{robot}/{key.leaf}"))
            for side in _QUERIED:
                token = session.liveliness().declare_subscriber(
                    f"{side}/{robot}/{ALIVE}", self._enqueue(self._meet), history=True
                )
                stack.enter_context(token)
            if self._camera:
                stack.callback(self._camera.close)
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def get(self, timeout: float) -> Event | None:
        """The next event; None when there is none for so many seconds."""
        end = time.monotonic() + timeout
        while True:
            try:
                event = self._queue.get(timeout=max(0.0, end - time.monotonic()))()
            except Empty:
                return None
            if event is not None:
                return event

    def introduced(self, side: str) -> bool:
        """Whether a side has been there and has answered what it was asked for."""
        return self._unanswered.get(side) == 0

    def _choose_camera(self) -> None:
        wanted = self._alive == {EMULATOR}
        if self._camera is None or wanted == self._camera_on:
            return
        self._camera_on = wanted
        if wanted:
            self._camera.enter_context(self._subscriber(f"{EMULATOR}/{self._robot}/{CAMERA}"))
        else:
            self._camera.close()

    def _subscriber(self, key: str) -> "zenoh.Subscriber[None]":
        return self._session.declare_subscriber(key, self._enqueue(self._take))

    def _enqueue(
        self, take: Callable[[zenoh.Sample, int], Event | None]
    ) -> Callable[[zenoh.Sample], None]:
        def enqueue(sample: zenoh.Sample) -> None:
            received = time.time_ns()
            self._queue.put(lambda: take(sample, received))

        return enqueue

    def _meet(self, sample: zenoh.Sample, received: int) -> Event:
        side = str(sample.key_expr).partition("/")[0]
        if sample.kind == zenoh.SampleKind.DELETE:
            self._alive.discard(side)
            self._choose_camera()
            return Presence(side, False, received)
        self._alive.add(side)
        self._choose_camera()
        prefix = f"{side}/{self._robot}/"
        self._newest = {k: v for k, v in self._newest.items() if not k.startswith(prefix)}
        self._unanswered[side] = len(_QUERIED[side])
        for leaf in _QUERIED[side]:
            self._session.get(prefix + leaf, self._answering(side), timeout=_QUERY_PATIENCE)
        return Presence(side, True, received)

    def _answering(self, side: str) -> Callable[[zenoh.Reply], None]:
        def enqueue(reply: zenoh.Reply) -> None:
            received = time.time_ns()
            self._queue.put(lambda: self._answer(side, reply, received))

        return enqueue

    def _answer(self, side: str, reply: zenoh.Reply, received: int) -> Event | None:
        self._unanswered[side] -= 1
        if reply.ok is None:  # there is nothing to tell yet
            return None
        return self._take(reply.ok, received, live=False)

    def _take(self, sample: zenoh.Sample, received: int, live: bool = True) -> Event | None:
        """A sample, unless it is known already or older than what is known."""
        key, timestamp = str(sample.key_expr), sample.timestamp
        if timestamp is not None:
            if key in self._newest and self._newest[key] >= timestamp:
                return None
            self._newest[key] = timestamp
        side, _, leaf = key.split("/")
        return Arrival(
            side,
            leaf,
            sample.payload.to_bytes(),
            str(sample.encoding),
            _stamp(sample),
            received,
            live,
        )


def _stamp(sample: zenoh.Sample) -> Stamp | None:
    if sample.attachment is None:
        return None
    try:
        return Stamp.model_validate_json(sample.attachment.to_bytes())
    except ValidationError:
        return None
