"""A ROS 2 node over Zenoh: its publishers and subscriptions, as other nodes see them."""

import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from typing import Any, Self

import zenoh

from macor_hil.errors import TelemetryError
from macor_hil.telemetry.ros2.messages import cdr
from macor_hil.telemetry.ros2.rmw_zenoh import LAST_DOMAIN, Node, Topic, attachment, gid


class RosNode:
    """A node; use as a context.

    Args:
        session: an open session, which stays its owner's.
        namespace: such as `/khepera`.
        name: of the node.
        domain: ROS_DOMAIN_ID.
        topics: that it publishes, under the names that `publish` knows them by.
        heard: topics that it subscribes to, with what takes their samples, in a thread of the
            library.

    Raises:
        TelemetryError: there is no such domain.
    """

    def __init__(
        self,
        session: zenoh.Session,
        namespace: str,
        name: str,
        domain: int,
        topics: dict[str, Topic],
        heard: Iterable[tuple[Topic, Callable[[zenoh.Sample], None]]] = (),
    ) -> None:
        if not 0 <= domain <= LAST_DOMAIN:
            raise TelemetryError(f"{domain} is no ROS domain; there are 0 to {LAST_DOMAIN}")
        node = Node(domain, str(session.zid()), namespace, name)
        with ExitStack() as stack:
            stack.enter_context(session.liveliness().declare_token(node.token()))
            self._publishers = {
                each: _Publisher(stack, session, node, number, topic)
                for number, (each, topic) in enumerate(topics.items(), start=1)
            }
            for number, (topic, take) in enumerate(heard, start=1 + len(topics)):
                token = node.subscription_token(number, topic)
                stack.enter_context(session.declare_subscriber(topic.key(domain), take))
                stack.enter_context(session.liveliness().declare_token(token))
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def publish(self, name: str, message: Any) -> None:
        """Publish a message on the topic of a name."""
        self._publishers[name].put(message)


class _Publisher:
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

    def put(self, message: Any) -> None:
        self._sequence += 1
        mark = attachment(self._sequence, time.time_ns(), self._gid)
        self._publisher.put(cdr(message), attachment=mark)
