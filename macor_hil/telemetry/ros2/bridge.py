"""The bridge: a watcher of a robot, and a ROS 2 node on its other side.

It is a process of its own, so that nothing of it is in the controller's loop.
"""

import logging
import time
from collections.abc import Iterable
from contextlib import ExitStack
from typing import Any, Final, Self

import zenoh
from khepera_protocol.zenoh.keys import WIRE
from khepera_protocol.zenoh.payload_model import PayloadError

from macor_hil.errors import TelemetryError, WrongPictureError
from macor_hil.hardware.odometry import Wheels
from macor_hil.hardware.robots.form import Reading
from macor_hil.hardware.robots.robot import RobotKind
from macor_hil.telemetry.feed import Arrival, Event, Feed, Loss, NotTaken, Refusal
from macor_hil.telemetry.ros2.messages import Frames
from macor_hil.telemetry.ros2.node import RosNode
from macor_hil.telemetry.ros2.rmw_zenoh import namespace_of
from macor_hil.telemetry.ros2.topics import COMMAND, KINDS, RosTopics, topic
from macor_hil.telemetry.ros2.twists import Twists

NODE: Final = "macor"
"""Name of the ROS node."""

_LOOK: Final = 0.2
"""Seconds to wait for an event."""

_log = logging.getLogger(__name__)


def bridge(session: zenoh.Session, robot: str, domain: int, frames: Frames) -> None:
    """Publish what is told of a robot as ROS 2 topics, until Ctrl-C; all may come and go.

    Args:
        session: an open session with emulator, controller and the ROS nodes or their router.
        robot: the robot's name in Zenoh keys; also the namespace of the topics.
        domain: ROS_DOMAIN_ID, 0 to 232.
        frames: names of the robot's frames.

    Raises:
        TelemetryError: the name or the domain cannot be used.
    """
    with Bridge(session, robot, domain, frames) as running:
        try:
            while True:
                running.forward()
        except KeyboardInterrupt:
            pass  # the way to end it


class Bridge:
    """A bridge from one robot's events to ROS 2; use as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: its name in the keys.
        domain: ROS_DOMAIN_ID.
        frames: names of the robot's frames.
        twists: takes what moves the robot, where ROS does that: its own readings are then told
            by `sense`, not by what watchers hear of its line.
        wheels: of the robot then.

    Raises:
        TelemetryError: the name cannot be part of a key, or there is no such domain.
    """

    def __init__(
        self,
        session: zenoh.Session,
        robot: str,
        domain: int = 0,
        frames: Frames | None = None,
        twists: Twists | None = None,
        wheels: Wheels | None = None,
    ) -> None:
        self._topics = RosTopics(robot, frames or Frames(), wheels or Wheels())
        self._driven = twists is not None
        self._not_taken = NotTaken()
        self._said = 0
        with ExitStack() as stack:
            self._feed = stack.enter_context(Feed(session, robot, camera=True))
            namespace = namespace_of(robot)
            topics = {
                name: topic(name, namespace) for name in KINDS if twists is None or name != COMMAND
            }
            heard = twists.heard() if twists else ()
            node = RosNode(session, namespace, NODE, domain, topics, heard)
            self._node = stack.enter_context(node)
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def forward(self, timeout: float = _LOOK) -> bool:
        """Wait for an event and forward it; what cannot be read is counted and logged.

        Returns:
            Whether one came.
        """
        event = self._feed.get(timeout)
        if isinstance(event, Refusal | Loss):
            self._leave_out(event)
        elif event is not None:
            self._tell(event)
        return event is not None

    def _tell(self, event: Event) -> None:
        if self._driven and isinstance(event, Arrival) and event.leaf == WIRE.leaf:
            return
        # the wall clock of other nodes, as it is now: this one's own does not follow its changes
        now = time.time_ns() - (self._feed.clock() - event.received)
        try:
            self._publish(self._topics.tell(event, now, self._not_taken.words()))
        except (PayloadError, TelemetryError, WrongPictureError) as error:
            leaf = event.leaf if isinstance(event, Arrival) else ""
            self._leave_out(Refusal(leaf, str(error), event.received))

    def meet(self, kind: RobotKind) -> None:
        """Take in of which kind the robot is that this program drives."""
        self._topics.kind = kind.value

    def sense(self, told: Reading, when: float) -> None:
        """Tell the robot's own readings.

        Args:
            told: they.
            when: seconds on the robot's clock.
        """
        self._publish(self._topics.sense(told, when, time.time_ns()))

    def _publish(self, messages: Iterable[tuple[str, Any]]) -> None:
        for name, message in messages:
            if name != COMMAND or not self._driven:
                self._node.publish(name, message)

    def _leave_out(self, what: Refusal | Loss) -> None:
        """Count what is not forwarded, and say so when the count has doubled."""
        self._not_taken.count(what)
        count = self._not_taken.refused + self._not_taken.lost
        if count >= 2 * self._said:
            self._said = count
            _log.warning("not forwarded: %s", self._not_taken.words())
