"""The controller's samples as ROS 2 messages in CDR, little-endian.

Header stamps are nanoseconds since 1970 on the wall clock, for every topic alike: ROS tools put
them on one time axis with those of other nodes. Speeds are per second of the robot's own clock.
"""

from functools import cache
from math import cos, sin
from typing import Any, Final

import numpy as np
from khepera_protocol.text import quoted
from khepera_protocol.zenoh.controller_payloads import Decision
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore
from rosbags.typesys.stores import ros2_jazzy as ros

from macor_hil.commands import COMMANDS
from macor_hil.errors import TelemetryError
from macor_hil.hardware.driver import DriveSettings
from macor_hil.telemetry.ros2.rmw_zenoh import Topic

ODOMETRY_FRAME: Final = "odom"
BODY_FRAME: Final = "base_link"
CAMERA_FRAME: Final = "camera"

_SECOND: Final = 1_000_000_000
_SHORTEST: Final = 0.001
"""Seconds that a command takes at least."""

_UNKNOWN: Final = np.zeros(36)
"""Covariance: all zero says that nobody knows, as the ROS message definitions have it."""


def image_topic(namespace: str) -> Topic:
    """Return the topic of the camera's pictures."""
    return _topic(f"{namespace}/image/compressed", ros.sensor_msgs__msg__CompressedImage)


def odometry_topic(namespace: str) -> Topic:
    """Return the topic of the robot's odometry."""
    return _topic(f"{namespace}/odom", ros.nav_msgs__msg__Odometry)


def command_topic(namespace: str) -> Topic:
    """Return the topic of the robot's commands."""
    return _topic(f"{namespace}/cmd_vel", ros.geometry_msgs__msg__TwistStamped)


def image(jpeg: bytes, time: int) -> bytes:
    """Return a `sensor_msgs/CompressedImage` of a JPEG file."""
    data = np.frombuffer(jpeg, np.uint8)
    return _cdr(ros.sensor_msgs__msg__CompressedImage(_header(time, CAMERA_FRAME), "jpeg", data))


def odometry(decision: Decision, before: Decision | None, time: int) -> bytes:
    """Return a `nav_msgs/Odometry`: the pose after a decision, the mean speed since the last."""
    pose = decision.odometry.pose
    half = pose.heading / 2
    turned = ros.geometry_msgs__msg__Quaternion(0.0, 0.0, sin(half), cos(half))
    place = ros.geometry_msgs__msg__Pose(ros.geometry_msgs__msg__Point(pose.x, pose.y, 0.0), turned)
    return _cdr(
        ros.nav_msgs__msg__Odometry(
            _header(time, ODOMETRY_FRAME),
            BODY_FRAME,
            ros.geometry_msgs__msg__PoseWithCovariance(place, _UNKNOWN),
            ros.geometry_msgs__msg__TwistWithCovariance(
                _twist(*_mean_speed(decision, before)), _UNKNOWN
            ),
        )
    )


def command(decision: Decision, time: int, drive: DriveSettings | None = None) -> bytes:
    """Return a `geometry_msgs/TwistStamped`: the arc of a decision's command at top speed.

    Raises:
        TelemetryError: there is no such command.
    """
    settings = drive or DriveSettings()
    arc = next((each for each in COMMANDS if each.name == decision.command), None)
    if arc is None:
        raise TelemetryError(f"there is no command {quoted(decision.command)}")
    longer = arc.way + abs(arc.turn) * settings.wheels.base / 2
    seconds = longer / (settings.speed * settings.wheels.left / 0.010)
    twist = _twist(arc.way / seconds, arc.turn / seconds)
    return _cdr(ros.geometry_msgs__msg__TwistStamped(_header(time, BODY_FRAME), twist))


def _mean_speed(decision: Decision, before: Decision | None) -> tuple[float, float]:
    """Return forward m/s and rad/s between two decisions; zero if they are not of one run."""
    if before is None or decision.sequence <= before.sequence:
        return 0.0, 0.0
    pose, last = decision.odometry.pose, before.odometry.pose
    seconds = decision.time - before.time
    if seconds < _SHORTEST:
        return 0.0, 0.0
    turn = pose.heading - last.heading
    middle = last.heading + turn / 2
    way = (pose.x - last.x) * cos(middle) + (pose.y - last.y) * sin(middle)
    return way / seconds, turn / seconds


def _header(time: int, frame: str) -> ros.std_msgs__msg__Header:
    return ros.std_msgs__msg__Header(
        ros.builtin_interfaces__msg__Time(time // _SECOND, time % _SECOND), frame
    )


def _twist(forward: float, turning: float) -> ros.geometry_msgs__msg__Twist:
    vector = ros.geometry_msgs__msg__Vector3
    return ros.geometry_msgs__msg__Twist(vector(forward, 0.0, 0.0), vector(0.0, 0.0, turning))


def _topic(name: str, message: Any) -> Topic:
    kind: str = message.__msgtype__
    return Topic(name, kind, _types().hash_rihs01(kind))


def _cdr(message: Any) -> bytes:
    return bytes(_types().serialize_cdr(message, message.__msgtype__))


@cache
def _types() -> Typestore:
    return get_typestore(Stores.ROS2_JAZZY)
