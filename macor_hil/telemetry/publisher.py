"""Publishes a run under `macor/<robot>/{frame,decision,map,state,link,alive}`.

Nothing here ever waits for a watcher. A subscriber that hangs while its link is up would hold a
blocking put for seconds, with a robot on the other line; so everything is dropped on congestion.
A put takes its time for every watcher all the same, and a picture wants to be encoded: a thread of
its own does that, while who drives waits for the robot.
Decisions and states travel at a higher priority than frames and do not queue behind them.
What is lost shows: the stamps count, and the latest decision and state can be asked for.
"""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Generic, Self, TypeVar

import cv2
import zenoh
from khepera_protocol.zenoh.controller_payloads import Decision, Learned, Link, State
from khepera_protocol.zenoh.keys import (
    CONTROLLER,
    CONTROLLER_ALIVE,
    DECISION,
    FRAME,
    LINK,
    MAP,
    STATE,
    Key,
)
from khepera_protocol.zenoh.payload_model import Payload
from khepera_protocol.zenoh.sample import (
    AnsweringPublisher,
    Content,
    SamplePublisher,
    SampleWriter,
    json_content,
)

from macor_hil.errors import TelemetryError
from macor_hil.hardware.cameras import Camera, Frame
from macor_hil.telemetry.sender import Sender
from macor_hil.telemetry.session import check_robot_name

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
            self._frames = _FrameKey(stack, session, robot)
            self._decisions = _JsonKey[Decision](stack, session, robot, DECISION)
            self._maps = _JsonKey[Learned](stack, session, robot, MAP)
            self._states = _JsonKey[State](stack, session, robot, STATE)
            self._links = _JsonKey[Link](stack, session, robot, LINK)
            alive = session.liveliness().declare_token(CONTROLLER_ALIVE.of(robot))
            stack.enter_context(alive)
            # the last one, and so the first to end: what it has left still goes out
            self._sender = stack.enter_context(Sender())
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def seen(self) -> bool:
        """True while anyone listens to pictures."""
        return self._frames.heard

    @property
    def waiting(self) -> int:
        """Number of samples that have not gone out yet."""
        return self._sender.waiting

    def check(self) -> None:
        """Check that samples still go out; for the loop that drives.

        Raises:
            TelemetryLostError: the thread that sends it has ended.
        """
        self._sender.check()

    def frame(self, frame: Frame) -> None:
        """Publish a mirror image as JPEG, if anyone listens."""
        self._sender.carry_out(lambda: self._frames.put(frame))

    def decision(self, decision: Decision) -> None:
        """Publish a decision."""
        self._sender.carry_out(self._decisions.prepared(decision, decision.time))

    def learned(self, learned: Learned, time: float) -> None:
        """Publish what a run drives by, as of a time in seconds on the robot's clock."""
        self._sender.carry_out(self._maps.prepared(learned, time))

    def link(self, link: Link) -> None:
        """Publish how the serial line does."""
        self._sender.carry_out(self._links.prepared(link, link.time))

    def state(self, state: State, time: float) -> None:
        """Publish the controller's state, as of a time in seconds on the robot's clock."""
        self._sender.carry_out(self._states.prepared(state, time))


class PublishingCamera:
    """A camera that publishes its pictures as they are taken."""

    def __init__(self, camera: Camera, publish: Callable[[Frame], None]) -> None:
        self.live = camera.live
        self._camera = camera
        self._publish = publish

    def grab(self) -> Frame:
        """Take a picture of this moment, and publish it."""
        frame = self._camera.grab()
        self._publish(frame)
        return frame

    def close(self) -> None:
        """Give the device back."""
        self._camera.close()


class _FrameKey:
    """The key of pictures; they are encoded and published only while someone listens."""

    def __init__(self, stack: ExitStack, session: zenoh.Session, robot: str) -> None:
        self._writer = SampleWriter(session, FRAME, robot)
        self._publisher = SamplePublisher(session, self._writer.name, zenoh.Priority.DATA_LOW)
        stack.callback(self._publisher.close)

    @property
    def heard(self) -> bool:
        return self._publisher.heard

    def put(self, frame: Frame) -> None:
        if not self.heard:
            return
        try:
            done, data = cv2.imencode(".jpeg", frame.image)
        except cv2.error:
            done = False
        if not done:
            raise TelemetryError(f"OpenCV cannot encode an image of shape {frame.image.shape}")
        content = Content(data.tobytes(), zenoh.Encoding.IMAGE_JPEG)
        self._publisher.put(self._writer.sample(content, frame.time))


class _JsonKey(Generic[_P]):
    """A key of JSON payloads; queries get the latest one, or the schema."""

    def __init__(self, stack: ExitStack, session: zenoh.Session, robot: str, key: Key) -> None:
        priority, missing = zenoh.Priority.DATA_HIGH, f"no {key.leaf} yet"
        self._key = AnsweringPublisher(session, key, robot, priority, missing)
        stack.callback(self._key.close)

    def prepared(self, payload: _P, time: float) -> Callable[[], None]:
        """Return an action that publishes a payload as it is now."""
        content = json_content(CONTROLLER, payload)
        # numbered by the thread that puts: several threads prepare
        return lambda: self._key.put(self._key.writer.sample(content, time))
