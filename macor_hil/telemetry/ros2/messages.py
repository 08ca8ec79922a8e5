"""Parts of ROS 2 messages, and messages in CDR, little-endian, with the topics that they are of.

Header stamps are nanoseconds since 1970 on the wall clock, for every topic alike: ROS tools put
them on one time axis with those of other nodes. Types are those of ROS 2 Jazzy.
"""

from dataclasses import dataclass
from functools import cache
from math import cos, sin
from typing import Any, Final

from khepera_protocol.zenoh.payloads import Pose
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore
from rosbags.typesys.stores import ros2_jazzy as ros

from macor_hil.telemetry.ros2.rmw_zenoh import Topic

_SECOND: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Frames:
    """Names of the frames of one robot.

    Attributes:
        prefix: before each of them, to tell robots apart.
    """

    prefix: str = ""

    @property
    def world(self) -> str:
        """Frame of the arena, which robots share."""
        return "map"

    @property
    def odometry(self) -> str:
        """Frame in which odometry counts."""
        return f"{self.prefix}odom"

    @property
    def body(self) -> str:
        """Frame of the robot."""
        return f"{self.prefix}base_link"

    @property
    def camera(self) -> str:
        """Frame of the camera."""
        return f"{self.prefix}camera"

    def sensor(self, number: int) -> str:
        """Return the frame of an infrared sensor."""
        return f"{self.prefix}ir{number}"


def topic_of(name: str, message: type[Any]) -> Topic:
    """Return a topic of messages of a class."""
    kind: str = message.__msgtype__
    return Topic(name, kind, types().hash_rihs01(kind))


def cdr(message: Any) -> bytes:
    """Return a message as it travels."""
    return bytes(types().serialize_cdr(message, message.__msgtype__))


@cache
def types() -> Typestore:
    """Return all types of ROS 2 Jazzy."""
    return get_typestore(Stores.ROS2_JAZZY)


def header(time: int, frame: str) -> ros.std_msgs__msg__Header:
    """Return a header: when (ns since 1970), and in which frame."""
    stamp = ros.builtin_interfaces__msg__Time(time // _SECOND, time % _SECOND)
    return ros.std_msgs__msg__Header(stamp, frame)


def point(x: float, y: float, z: float = 0.0) -> ros.geometry_msgs__msg__Point:
    """Return a place, metres."""
    return ros.geometry_msgs__msg__Point(x, y, z)


def vector(x: float, y: float, z: float) -> ros.geometry_msgs__msg__Vector3:
    """Return a vector."""
    return ros.geometry_msgs__msg__Vector3(x, y, z)


def heading(angle: float) -> ros.geometry_msgs__msg__Quaternion:
    """Return a turn to the left by radians."""
    return ros.geometry_msgs__msg__Quaternion(0.0, 0.0, sin(angle / 2), cos(angle / 2))


def pose(place: Pose, height: float = 0.0) -> ros.geometry_msgs__msg__Pose:
    """Return a pose on the floor, or above it."""
    return ros.geometry_msgs__msg__Pose(point(place.x, place.y, height), heading(place.heading))


def twist(forward: float, turning: float) -> ros.geometry_msgs__msg__Twist:
    """Return a motion: m/s ahead, rad/s to the left."""
    return ros.geometry_msgs__msg__Twist(vector(forward, 0.0, 0.0), vector(0.0, 0.0, turning))
