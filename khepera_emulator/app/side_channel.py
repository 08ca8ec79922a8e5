"""Camera, ground truth and reset of an emulated robot over Zenoh, which never go on the line.

So do the bytes on the line themselves, for those who watch it.

Zenoh calls back in threads of its own. They only put queries on a list and wake the emulator's
thread, which answers them between two portions of the serial line. Whatever fails meanwhile is the
answer, or is logged: nobody who asks, or looks, ends the emulator.
"""

import logging
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Final, Self, TypeVar

import cv2
import zenoh
from khepera_protocol.text import printable
from khepera_protocol.validation import first_fault
from khepera_protocol.zenoh.keys import (
    ARENA,
    CAMERA,
    EMULATOR,
    EMULATOR_ALIVE,
    FAULTS,
    PUSH,
    RESET,
    TRUTH,
    WIRE,
    Key,
)
from khepera_protocol.zenoh.payload_model import MOST_NAME, Payload
from khepera_protocol.zenoh.payloads import CameraQuery, FaultSwitch, Outline, Push, Reset, Wire
from khepera_protocol.zenoh.sample import Content, SamplePublisher, SampleWriter, json_content
from khepera_protocol.zenoh.session import open_session
from pydantic import ValidationError

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.wire_tap import WireTap
from khepera_emulator.ports.bell import Bell
from khepera_emulator.robot.emulator import Emulator

_log = logging.getLogger(__name__)

TRUTH_RATE = 10.0
"""Ground truths a second, published while someone listens."""

WIRE_RATE = 10.0
"""Times a second that what passed on the line is published, while someone listens."""

_HARMLESS = frozenset({TRUTH, ARENA})
_MOST_WAITING = 64
_LONGEST_REQUEST = 10_000
"""Bytes of a query's payload that are read."""

_LONGEST_REASON = 300
_ENCODINGS = {"png": zenoh.Encoding.IMAGE_PNG, "jpeg": zenoh.Encoding.IMAGE_JPEG}
_JPEG_FRAME = CameraQuery(encoding="jpeg").model_dump_json().encode()

_P = TypeVar("_P", bound=Payload)

open_zenoh: Final = partial(
    open_session, error=EmulatorError, if_in_use="; give another --listen endpoint, or --no-zenoh"
)
"""Open the session of an emulator; one that cannot be opened is an EmulatorError."""


_Answer = Callable[[Emulator, bytes], Content]


class SideChannel:
    """Zenoh keys of one emulated robot; use as a context.

    Streams keep their rates in real time, whatever the robot's clock does: watching costs the
    same at any speed.

    Args:
        robot: its name in the keys.
        listen: endpoints to listen on.
        connect: endpoints of peers to connect to, now or when they appear.
        camera_rate: frames a second of the camera's stream.
        beside: another robot's channel, whose session it shares instead of one of its own.
        config: Zenoh's own configuration, instead of `listen` and `connect`.
        looking: offer the arena and the truth alone: nothing that could change what happens, as a
            reset or another picture with noise of its own would.

    Attributes:
        tap: is told what passes on the line, to be published.

    Raises:
        EmulatorError: an endpoint is malformed or already in use.
    """

    def __init__(
        self,
        robot: str,
        listen: Sequence[str],
        connect: Sequence[str] = (),
        camera_rate: float = 10.0,
        beside: "SideChannel | None" = None,
        config: Path | None = None,
        *,
        looking: bool = False,
    ) -> None:
        self._waiting: deque[tuple[_Replier, zenoh.Query]] = deque()
        with ExitStack() as stack:
            self._wake = Bell()
            stack.callback(self._wake.close)
            self._session: zenoh.Session = (
                beside._session
                if beside
                else stack.enter_context(open_zenoh(listen, connect, config))
            )
            self.tap = WireTap()
            outlines = _Outlines(str(self._session.zid()))
            answers = {
                **_ANSWERS,
                ARENA: lambda emulator, _: outlines.now(emulator),
                PUSH: lambda emulator, request: outlines.push(emulator, request),
                WIRE: lambda emulator, _: _wire(emulator, self.tap.since(0)),
            }
            streams: dict[Key, tuple[float, Callable[[Emulator], Content | None]]] = {
                CAMERA: (camera_rate, lambda emulator: _camera(emulator, _JPEG_FRAME)),
                TRUTH: (TRUTH_RATE, lambda emulator: _json(emulator.truth())),
                ARENA: (TRUTH_RATE, outlines.moved),
                WIRE: (WIRE_RATE, _fresh_entries(self.tap)),
            }
            offered = [key for key in answers if key in _HARMLESS or not looking]
            # streams of one rate are due together: one wake-up for all of them
            start = time.monotonic()
            self._streams = [
                _Stream(
                    start, SampleWriter(self._session, key, robot), self._session, *streams[key]
                )
                for key in streams
                if key in offered
            ]
            for stream in self._streams:
                stack.callback(stream.close)
            for key in offered:
                self._answer(stack, _Replier(self._session, robot, key, answers[key]))
            alive = self._session.liveliness().declare_token(EMULATOR_ALIVE.of(robot))
            stack.callback(alive.undeclare)
            self._stack = stack.pop_all()

    @property
    def session(self) -> zenoh.Session:
        """The session of the channel, for as long as it is open."""
        return self._session

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def fileno(self) -> int:
        """Return the descriptor that becomes readable when a query has come."""
        return self._wake.fileno()

    def delay(self) -> float:
        """Return the real seconds until `serve` is due; 0 when it is."""
        if self._waiting:
            return 0.0
        return max(0.0, min(stream.next for stream in self._streams) - time.monotonic())

    def serve(self, emulator: Emulator) -> None:
        """Answer one query and publish what is due, all as of `emulator.now`."""
        self._wake.silence()
        if self._waiting:
            replier, query = self._waiting.popleft()
            with query:
                replier.reply(query, emulator)
        for stream in self._streams:
            stream.publish_if_due(emulator)

    def _answer(self, stack: ExitStack, replier: "_Replier") -> None:
        """Answer the queries on a key until the stack ends."""

        def enqueue(query: zenoh.Query) -> None:
            if len(self._waiting) >= _MOST_WAITING:
                with query:
                    query.reply_err(f"{_MOST_WAITING} queries wait already; ask less often")
                return
            self._waiting.append((replier, query))
            self._wake.ring()

        queryable = self._session.declare_queryable(replier.name, enqueue)
        # the session may live on: that of a channel beside this one
        stack.callback(queryable.undeclare)


class _Guard:
    """Survives whatever fails within it; use as a context.

    Args:
        tell: is given what has failed.
    """

    def __init__(self, tell: Callable[[Exception], None]) -> None:
        self._tell = tell

    def __enter__(self) -> None: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> bool:
        if not isinstance(error, Exception):
            return False  # nothing failed, or the process is told to end
        self._tell(error)
        return True


class _Replier:
    """Answers the queries on one key.

    Attributes:
        name: the key, with the robot's name in it.
    """

    def __init__(self, session: zenoh.Session, robot: str, key: Key, answer: _Answer) -> None:
        self._writer = SampleWriter(session, key, robot)
        self.name = self._writer.name
        self._key = key
        self._answer = answer

    def reply(self, query: zenoh.Query, emulator: Emulator) -> None:
        """Answer a query, if need be with what fails."""

        def refuse(error: Exception) -> None:
            reason = _reason(error)
            if isinstance(error, EmulatorError):
                _log.info("a query on %s is refused: %s", self.name, reason)
            else:
                _log.error("a query on %s failed", self.name, exc_info=error)
            with suppress(zenoh.ZError):  # who asked has gone
                query.reply_err(reason, encoding=zenoh.Encoding.TEXT_PLAIN)

        with _Guard(refuse):
            if self._writer.describe(query):
                return
            if not self._key.acts or str(query.key_expr) == self.name:
                content = self._answer(emulator, self._request(query))
                self._writer.reply(query, self._writer.sample(content, emulator.now))
            # else: somebody looks at what there is, and means no harm

    def _request(self, query: zenoh.Query) -> bytes:
        payload = query.payload
        if payload is None or not len(payload):
            if self._key.acts and self._key.request:
                raise EmulatorError(
                    f"{self.name} takes a payload that says what to do, if only {{}}: a"
                    f" {self._key.request.__name__} in JSON, see docs/keys.md"
                )
            return b""
        if len(payload) > _LONGEST_REQUEST:
            raise EmulatorError(
                f"the payload has {len(payload):,} bytes, and {_LONGEST_REQUEST:,} at most are read"
            )
        return payload.to_bytes()


class _Stream:
    """Publishes one kind of sample at a rate, made only while someone listens.

    Attributes:
        next: when the next sample is due, in seconds of `time.monotonic`.
    """

    def __init__(
        self,
        start: float,
        writer: SampleWriter,
        session: zenoh.Session,
        rate: float,
        content: Callable[[Emulator], Content | None],
    ) -> None:
        self.next = start
        self._writer = writer
        self._publisher = SamplePublisher(session, writer.name)
        self._period = 1.0 / rate
        self._content = content
        self._failure = ""

    def close(self) -> None:
        """Publish no more."""
        self._publisher.close()

    def publish_if_due(self, emulator: Emulator) -> None:
        now = time.monotonic()
        if now < self.next:
            return
        self.next = max(self.next + self._period, now)  # what is missed is not made up for
        with _Guard(self._fail):
            if self._publisher.heard:
                self._publish(emulator)

    def _publish(self, emulator: Emulator) -> None:
        content = self._content(emulator)
        if content is not None:
            self._publisher.put(self._writer.sample(content, emulator.now))
            self._failure = ""

    def _fail(self, error: Exception) -> None:
        reason = _reason(error)
        if reason != self._failure:  # not ten times a second
            self._failure = reason
            _log.error("a sample of %s failed", self._writer.name, exc_info=error)


def _reason(error: Exception) -> str:
    """Tell in a sentence why something failed; the text of an error may be foreign."""
    if isinstance(error, EmulatorError):
        return printable(str(error), _LONGEST_REASON)
    return printable(f"the emulator failed: {type(error).__name__}: {error}", _LONGEST_REASON)


def _camera(emulator: Emulator, request: bytes) -> Content:
    query = _parse(CameraQuery, request)
    image = emulator.panorama() if query.view == "panorama" else emulator.mirror_image()
    done, data = cv2.imencode(f".{query.encoding}", image)
    if not done:
        raise EmulatorError(f"OpenCV cannot encode an image as {query.encoding}")
    return Content(data.tobytes(), _ENCODINGS[query.encoding])


def _truth(emulator: Emulator, _: bytes) -> Content:
    return _json(emulator.truth())


def _reset(emulator: Emulator, request: bytes) -> Content:
    return _json(emulator.reset(_parse(Reset, request)))


def _faults(emulator: Emulator, request: bytes) -> Content:
    return _json(emulator.switch_faults(_parse(FaultSwitch, request)))


class _Outlines:
    """The arena from above, as the robots of one world tell it.

    Args:
        world: a name of the world.
    """

    def __init__(self, world: str) -> None:
        self._world = world
        self._told: object = None

    def now(self, emulator: Emulator) -> Content:
        """Return the arena as it is."""
        return self._content(emulator.outline())

    def push(self, emulator: Emulator, request: bytes) -> Content:
        """Put a thing somewhere else."""
        return self._content(emulator.push(_parse(Push, request)))

    def moved(self, emulator: Emulator) -> Content | None:
        """Return the arena if a thing has moved since the last call."""
        arrangement = emulator.arrangement
        if arrangement == self._told:
            return None
        self._told = arrangement
        return self.now(emulator)

    def _content(self, outline: Outline) -> Content:
        return _json(outline.model_copy(update={"world": self._world}))


def _wire(emulator: Emulator, passed: Wire) -> Content:
    """Return what passed on a line, and how it is to be read."""
    kind, dialect = emulator.setup.model.kind[:MOST_NAME], emulator.uart.dialect.name
    return _json(passed.model_copy(update={"robot_kind": kind, "dialect": dialect}))


def _fresh_entries(tap: WireTap) -> Callable[[Emulator], Content | None]:
    """Return a function that tells the entries of the line since its last call; None for none."""
    told = 0

    def fresh(emulator: Emulator) -> Content | None:
        nonlocal told
        if tap.count == told:
            return None
        content = _wire(emulator, tap.since(told))
        told = tap.count
        return content

    return fresh


_ANSWERS: Mapping[Key, _Answer] = MappingProxyType(
    {CAMERA: _camera, TRUTH: _truth, RESET: _reset, FAULTS: _faults}
)


def _parse(kind: type[_P], request: bytes) -> _P:
    try:
        return kind.model_validate_json(request or b"{}")
    except ValidationError as error:
        raise EmulatorError(first_fault(error, "the payload")) from None


def _json(payload: Payload) -> Content:
    return json_content(EMULATOR, payload)
