"""The bridge: a subscriber of a controller, and a ROS 2 node on its other side.

It is a process of its own, so that nothing of it is in the controller's loop. Zenoh calls back in
threads of its own; they only put what came on a queue.
"""

import logging
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final, Self

import zenoh
from khepera_protocol.zenoh.controller_payloads import Decision
from khepera_protocol.zenoh.keys import DECISION, FRAME, Key
from khepera_protocol.zenoh.payload_model import PayloadError
from khepera_protocol.zenoh.sample_checks import check_sample, size_of

from macor_hil.errors import TelemetryError, WrongPictureError
from macor_hil.hardware.cameras.decoding import check_picture
from macor_hil.telemetry.feed import Loss, NotTaken, Refusal
from macor_hil.telemetry.inbox import Inbox
from macor_hil.telemetry.ros2 import messages
from macor_hil.telemetry.ros2.rmw_zenoh import (
    LAST_DOMAIN,
    Node,
    Topic,
    attachment,
    gid,
    namespace_of,
)
from macor_hil.telemetry.session import check_robot_name, open_session

NODE: Final = "macor"
"""Name of the ROS node."""

_LOOK: Final = 0.2
"""Seconds to wait for a sample."""

_LAST_SECOND: Final = 2**31
"""ROS counts seconds in 32 bits."""

_log = logging.getLogger(__name__)


def bridge(robot: str, connect: Sequence[str], domain: int = 0, config: Path | None = None) -> None:
    """Publish what a controller tells as ROS 2 topics, until Ctrl-C; it may come and go.

    Args:
        robot: the robot's name in Zenoh keys; also the namespace of the topics.
        connect: Zenoh endpoints of the controller, and of the ROS nodes or their router.
        domain: ROS_DOMAIN_ID, 0 to 232.
        config: a configuration file of Zenoh, which then counts instead of `connect`.

    Raises:
        TelemetryError: the name, the domain, an endpoint or the file cannot be used.
    """
    with open_session([], connect, config) as session, Bridge(session, robot, domain) as running:
        try:
            while True:
                running.forward()
        except KeyboardInterrupt:
            pass  # the way to end it


class Bridge:
    """A bridge from one robot's samples to ROS 2; use as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: its name in the keys of its controller.
        domain: ROS_DOMAIN_ID.

    Raises:
        TelemetryError: the name cannot be part of a key, or there is no such domain.
    """

    def __init__(self, session: zenoh.Session, robot: str, domain: int = 0) -> None:
        check_robot_name(robot)
        if not 0 <= domain <= LAST_DOMAIN:
            raise TelemetryError(f"{domain} is no ROS domain; there are 0 to {LAST_DOMAIN}")
        namespace = namespace_of(robot)
        self._robot = robot
        node = Node(domain, str(session.zid()), namespace, NODE)
        self._inbox: Inbox[tuple[Key, zenoh.Sample]] = Inbox()
        self._not_taken = NotTaken()
        self._said = 0
        self._last: Decision | None = None
        with ExitStack() as stack:
            stack.enter_context(session.liveliness().declare_token(node.token()))
            topics = messages.image_topic, messages.odometry_topic, messages.command_topic
            self._image, self._odometry, self._command = (
                _RosPublisher(stack, session, node, number, topic(namespace))
                for number, topic in enumerate(topics, start=1)
            )
            for key in (FRAME, DECISION):
                subscriber = session.declare_subscriber(key.of(robot), self._taking(key))
                stack.enter_context(subscriber)
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def forward(self, timeout: float = _LOOK) -> None:
        """Wait for a sample and forward it; one that cannot be read is counted and logged."""
        if lost := self._inbox.take_losses():
            self._leave_out(Loss(lost, time.time_ns()))
        came = self._inbox.get(timeout)
        if came is None:
            return
        key, sample = came
        try:
            check_sample(sample, key.of(self._robot), key.limit)
            if key is FRAME:
                picture = sample.payload.to_bytes()
                check_picture(picture, "it is no picture")
                self._image.put(messages.image(picture, _stamped(sample)))
            else:
                self._tell(Decision.parse(sample.payload.to_bytes()), _stamped(sample))
        except (PayloadError, TelemetryError, WrongPictureError) as error:
            self._leave_out(Refusal(key.leaf, str(error), time.time_ns()))

    def _taking(self, key: Key) -> Callable[[zenoh.Sample], None]:
        return lambda sample: self._inbox.put((key, sample), size_of(sample))

    def _tell(self, decision: Decision, when: int) -> None:
        self._command.put(messages.command(decision, when))
        self._odometry.put(messages.odometry(decision, self._last, when))
        self._last = decision

    def _leave_out(self, what: Refusal | Loss) -> None:
        """Count what is not forwarded, and say so when the count has doubled."""
        self._not_taken.count(what)
        count = self._not_taken.refused + self._not_taken.lost
        if count >= 2 * self._said:
            self._said = count
            _log.warning("not forwarded: %s", self._not_taken.words())


class _RosPublisher:
    """A publisher as ROS 2 nodes see one."""

    def __init__(
        self, stack: ExitStack, session: zenoh.Session, node: Node, number: int, topic: Topic
    ) -> None:
        token = node.publisher_token(number, topic)
        self._gid = gid(token)
        self._sequence = 0
        publisher = session.declare_publisher(
            topic.key(node.domain), congestion_control=zenoh.CongestionControl.DROP
        )
        self._publisher = stack.enter_context(publisher)
        stack.enter_context(session.liveliness().declare_token(token))

    def put(self, message: bytes) -> None:
        self._sequence += 1
        mark = attachment(self._sequence, time.time_ns(), self._gid)
        self._publisher.put(message, attachment=mark)


def _stamped(sample: zenoh.Sample) -> int:
    """Return the wall clock of a sample, nanoseconds since 1970; now, if ROS could not hold it."""
    if sample.timestamp is None:
        return time.time_ns()
    when: int = sample.timestamp.get_time_as_ntp64().as_nanos()
    return when if when < _LAST_SECOND * 1_000_000_000 else time.time_ns()
