"""Names and attachments of the ROS 2 Zenoh middleware (rmw_zenoh); no I/O.

After its design document (github.com/ros2/rmw_zenoh, docs/design.md), as of ROS 2 Jazzy: a topic is
a Zenoh key of domain, name, type and type hash; a sample carries an attachment of 33 bytes; nodes
and publishers are found by liveliness tokens, whose text, hashed, is the publisher's GID.
"""

import re
import struct
from dataclasses import dataclass
from typing import Final

import xxhash

from macor_hil.errors import TelemetryError

LAST_DOMAIN: Final = 232
"""Greatest ROS_DOMAIN_ID."""

DEPTH: Final = 10
"""Samples that a publisher announces to keep."""

_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_NOT_ROS = re.compile(r"[^A-Za-z0-9_]")
_ATTACHMENT = struct.Struct("<qqB16s")


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic.

    Attributes:
        name: fully qualified, such as `/khepera/odom`.
        kind: of its messages, such as `nav_msgs/msg/Odometry`.
        kind_hash: of that kind's definition, `RIHS01_` and 64 hexadecimal digits.
    """

    name: str
    kind: str
    kind_hash: str

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise TelemetryError(f"{self.name!r} is no ROS topic; one looks like /khepera/odom")

    @property
    def dds_kind(self) -> str:
        """The kind as it is named in keys: `nav_msgs::msg::dds_::Odometry_`."""
        *package, name = self.kind.split("/")
        return "::".join([*package, "dds_", f"{name}_"])

    def key(self, domain: int) -> str:
        """Return the Zenoh key of the topic in a domain."""
        return f"{domain}/{self.name[1:]}/{self.dds_kind}/{self.kind_hash}"


@dataclass(frozen=True, slots=True)
class Node:
    """A ROS node, with the only context of its Zenoh session.

    Attributes:
        domain: ROS_DOMAIN_ID.
        session: id of the Zenoh session, hexadecimal.
        namespace: `/` or such as `/khepera`.
        name: of the node in it.
    """

    domain: int
    session: str
    namespace: str
    name: str

    def token(self) -> str:
        """Return the key of the liveliness token that says that the node is there."""
        return self._entity(0, "NN")

    def publisher_token(self, number: int, topic: Topic, depth: int = DEPTH) -> str:
        """Return the key of a publisher's liveliness token: reliable, volatile, keeps samples.

        Args:
            number: of the publisher in its node, 1 or greater.
            topic: what it publishes.
            depth: samples that it keeps.
        """
        return self._end(number, "MP", topic, depth)

    def subscription_token(self, number: int, topic: Topic, depth: int = DEPTH) -> str:
        """Return the key of a subscription's liveliness token, likewise."""
        return self._end(number, "MS", topic, depth)

    def _end(self, number: int, kind: str, topic: Topic, depth: int) -> str:
        what = f"{_mangled(topic.name)}/{topic.dds_kind}/{topic.kind_hash}"
        # parts are empty where they are rmw_zenoh's defaults, and have to be: the GID hashes them
        return f"{self._entity(number, kind)}/{what}/::,{depth}:,:,:,,"

    def _entity(self, number: int, kind: str) -> str:
        enclave = "%"
        place = f"{enclave}/{_mangled(self.namespace)}/{self.name}"
        return f"@ros2_lv/{self.domain}/{self.session}/0/{number}/{kind}/{place}"


def gid(token: str) -> bytes:
    """Return the GID of the publisher with this liveliness token, 16 bytes."""
    return xxhash.xxh3_128(token.encode()).intdigest().to_bytes(16, "little")


def attachment(sequence: int, time: int, publisher: bytes) -> bytes:
    """Return the attachment of a sample.

    Args:
        sequence: number of the sample, from 1.
        time: when it was sent, nanoseconds since 1970.
        publisher: its GID.
    """
    return _ATTACHMENT.pack(sequence, time, len(publisher), publisher)


def namespace_of(robot: str) -> str:
    """Return a robot's namespace: its name, with underscores for what ROS names must not hold."""
    name = _NOT_ROS.sub("_", robot)
    return f"/robot_{name}" if name[0].isdigit() else f"/{name}"


def _mangled(name: str) -> str:
    return name.replace("/", "%")
