"""Publishes a run under `macor/<robot>/{frame,decision,map,state,link,alive}`.

Nothing here ever waits for a watcher. A subscriber that hangs while its link is up would hold a
blocking put for seconds, with a robot on the other line; so everything is dropped on congestion.
A put takes its time for every watcher all the same, and a picture wants to be encoded: a thread of
its own does that, while who drives waits for the robot.
Decisions and states travel at a higher priority than frames and do not queue behind them.
What is lost shows: the stamps count, and the latest decision and state can be asked for.
"""

import json
from collections.abc import Callable
from contextlib import ExitStack
from typing import Final, Generic, Self, TypeVar, cast

import cv2
import zenoh
from khepera_protocol.zenoh.keys import CONTROLLER, DESCRIBE, SCHEMA_MEDIA_TYPE, schema_name
from khepera_protocol.zenoh.payloads import Payload, Stamp, controller_key
from khepera_protocol.zenoh.schema import schema_of

from macor_hil.errors import TelemetryError
from macor_hil.hardware.cameras import Camera, Frame
from macor_hil.telemetry.keys import ALIVE, DECISION, FRAME, LINK, MAP, STATE
from macor_hil.telemetry.schemas import Decision, Learned, Link, State
from macor_hil.telemetry.sender import Outbox
from macor_hil.telemetry.session import check_robot_name

SCHEMA_ENCODING: Final = zenoh.Encoding(SCHEMA_MEDIA_TYPE)

_P = TypeVar("_P", bound=Payload)


class Publisher:
    """Publisher of one robot's controller; use as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: the robot's name in the keys.

    Raises:
        TelemetryError: the name cannot be part of a key.
    """

    def __init__(self, session: zenoh.Session, robot: str) -> None:
        check_robot_name(robot)
        with ExitStack() as stack:
            self._frames = _FrameKey(stack, session, controller_key(robot, FRAME))
            self._decisions = _JsonKey(stack, session, controller_key(robot, DECISION), Decision)
            self._maps = _JsonKey(stack, session, controller_key(robot, MAP), Learned)
            self._states = _JsonKey(stack, session, controller_key(robot, STATE), State)
            self._links = _JsonKey(stack, session, controller_key(robot, LINK), Link)
            alive = session.liveliness().declare_token(controller_key(robot, ALIVE))
            stack.enter_context(alive)
            # the last one, and so the first to end: what it has left still goes out
            self._outbox = stack.enter_context(Outbox())
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def check(self) -> None:
        """See that what is published goes out; for who drives.

        Raises:
            TelemetryError: the thread that sends it has ended.
        """
        self._outbox.check()

    def frame(self, frame: Frame) -> None:
        """Publish a mirror image as JPEG, if anyone listens."""
        self._outbox.carry_out(lambda: self._frames.put(frame))

    def decision(self, decision: Decision) -> None:
        """Publish a decision."""
        self._outbox.carry_out(self._decisions.prepared(decision, decision.time))

    def learned(self, learned: Learned, time: float) -> None:
        """Publish what a run drives by, as of a time in seconds on the robot's clock."""
        self._outbox.carry_out(self._maps.prepared(learned, time))

    def link(self, link: Link) -> None:
        """Publish how the serial line does."""
        self._outbox.carry_out(self._links.prepared(link, link.time))

    def state(self, state: State, time: float) -> None:
        """Publish the controller's state, as of a time in seconds on the robot's clock."""
        self._outbox.carry_out(self._states.prepared(state, time))


class WatchedCamera:
    """A camera whose pictures are published as they are taken."""

    def __init__(self, camera: Camera, publish: Callable[[Frame], None]) -> None:
        self.live = camera.live
        self._camera = camera
        self._publish = publish

    def grab(self) -> Frame:
        """A picture of this moment."""
        frame = self._camera.grab()
        self._publish(frame)
        return frame

    def close(self) -> None:
        """Give the device back."""
        self._camera.close()


def json_encoding(kind: type[Payload]) -> zenoh.Encoding:
    """Encoding of a JSON payload: `application/json;` and the name of its schema."""
    return zenoh.Encoding.APPLICATION_JSON.with_schema(schema_name(CONTROLLER, kind))


class _FrameKey:
    """Puts pictures on a key while someone listens."""

    def __init__(self, stack: ExitStack, session: zenoh.Session, key: str) -> None:
        self._session = session
        publisher = session.declare_publisher(
            key,
            encoding=zenoh.Encoding.IMAGE_JPEG,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.DATA_LOW,
        )
        self._publisher = stack.enter_context(publisher)
        self._sequence = 0

    def put(self, frame: Frame) -> None:
        # the library's stub calls this a bool; it is an object, and as such always true
        status = cast(zenoh.MatchingStatus, self._publisher.matching_status)
        if not status.matching:
            return
        try:
            done, data = cv2.imencode(".jpeg", frame.image)
        except cv2.error:
            done = False
        if not done:
            raise TelemetryError(f"OpenCV cannot encode an image of shape {frame.image.shape}")
        self._publisher.put(
            data.tobytes(),
            attachment=Stamp(sequence=self._sequence, time=frame.time).model_dump_json(),
            timestamp=self._session.new_timestamp(),
        )
        self._sequence += 1


class _JsonKey(Generic[_P]):
    """Puts payloads of one model on a key; answers queries with the latest one or the schema."""

    def __init__(self, stack: ExitStack, session: zenoh.Session, key: str, kind: type[_P]) -> None:
        self._session = session
        self._key = key
        self._kind = kind
        self._encoding = json_encoding(kind)
        self._sequence = 0
        # replaced as a whole, for the library's thread that answers the queries
        self._latest: tuple[str, str, zenoh.Timestamp] | None = None
        publisher = session.declare_publisher(
            key,
            encoding=self._encoding,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.DATA_HIGH,
        )
        self._publisher = stack.enter_context(publisher)
        stack.enter_context(session.declare_queryable(key, self._answer))

    def prepared(self, payload: _P, time: float) -> Callable[[], None]:
        """What puts a payload on the key; who asks gets it from then on."""
        text = payload.model_dump_json()

        def put() -> None:
            # in the thread that puts: several threads prepare, and the stamps count what is put
            stamp = Stamp(sequence=self._sequence, time=time).model_dump_json()
            timestamp = self._session.new_timestamp()
            self._sequence += 1
            try:
                self._publisher.put(text, attachment=stamp, timestamp=timestamp)
            finally:
                # not before: who joins would get an answer that overtakes what is on its way
                self._latest = text, stamp, timestamp

        return put

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            if DESCRIBE in query.parameters:
                schema = json.dumps(schema_of(self._kind))
                query.reply(self._key, schema, encoding=SCHEMA_ENCODING)
            elif self._latest is None:
                query.reply_err(
                    f"no {self._kind.__name__.lower()} yet", encoding=zenoh.Encoding.TEXT_PLAIN
                )
            else:
                text, stamp, timestamp = self._latest
                query.reply(
                    self._key,
                    text,
                    encoding=self._encoding,
                    attachment=stamp,
                    timestamp=timestamp,
                )
