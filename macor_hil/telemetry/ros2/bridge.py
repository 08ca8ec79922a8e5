"""The bridge: a watcher of a robot, and a ROS 2 node on its other side.

It is a process of its own, so that nothing of it is in the controller's loop.
"""

import logging
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final, Self

import zenoh
from khepera_protocol.zenoh.payload_model import PayloadError

from macor_hil.errors import TelemetryError, WrongPictureError
from macor_hil.telemetry.feed import Arrival, Feed, Loss, NotTaken, Refusal
from macor_hil.telemetry.ros2.messages import Frames
from macor_hil.telemetry.ros2.node import RosNode
from macor_hil.telemetry.ros2.rmw_zenoh import namespace_of
from macor_hil.telemetry.ros2.topics import KINDS, RosTopics, topic
from macor_hil.telemetry.session import open_session

NODE: Final = "macor"
"""Name of the ROS node."""

_LOOK: Final = 0.2
"""Seconds to wait for an event."""

_log = logging.getLogger(__name__)


def bridge(
    robot: str,
    connect: Sequence[str],
    domain: int = 0,
    config: Path | None = None,
    frame_prefix: str = "",
) -> None:
    """Publish what is told of a robot as ROS 2 topics, until Ctrl-C; all may come and go.

    Args:
        robot: the robot's name in Zenoh keys; also the namespace of the topics.
        connect: Zenoh endpoints of emulator and controller, and of the ROS nodes or their router.
        domain: ROS_DOMAIN_ID, 0 to 232.
        config: a configuration file of Zenoh, which then counts instead of `connect`.
        frame_prefix: before the names of the robot's frames.

    Raises:
        TelemetryError: the name, the domain, an endpoint or the file cannot be used.
    """
    with (
        open_session([], connect, config) as session,
        Bridge(session, robot, domain, Frames(frame_prefix)) as running,
    ):
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

    Raises:
        TelemetryError: the name cannot be part of a key, or there is no such domain.
    """

    def __init__(
        self, session: zenoh.Session, robot: str, domain: int = 0, frames: Frames | None = None
    ) -> None:
        self._topics = RosTopics(robot, frames or Frames())
        self._not_taken = NotTaken()
        self._said = 0
        with ExitStack() as stack:
            self._feed = stack.enter_context(Feed(session, robot, camera=True))
            namespace = namespace_of(robot)
            topics = {name: topic(name, namespace) for name in KINDS}
            self._node = stack.enter_context(RosNode(session, namespace, NODE, domain, topics))
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def forward(self, timeout: float = _LOOK) -> None:
        """Wait for an event and forward it; what cannot be read is counted and logged."""
        event = self._feed.get(timeout)
        if event is None:
            return
        if isinstance(event, Refusal | Loss):
            self._leave_out(event)
            return
        # the wall clock of other nodes, as it is now: this one's own does not follow its changes
        now = time.time_ns() - (self._feed.clock() - event.received)
        try:
            for name, message in self._topics.tell(event, now, self._not_taken.words()):
                self._node.publish(name, message)
        except (PayloadError, TelemetryError, WrongPictureError) as error:
            leaf = event.leaf if isinstance(event, Arrival) else ""
            self._leave_out(Refusal(leaf, str(error), event.received))

    def _leave_out(self, what: Refusal | Loss) -> None:
        """Count what is not forwarded, and say so when the count has doubled."""
        self._not_taken.count(what)
        count = self._not_taken.refused + self._not_taken.lost
        if count >= 2 * self._said:
            self._said = count
            _log.warning("not forwarded: %s", self._not_taken.words())
