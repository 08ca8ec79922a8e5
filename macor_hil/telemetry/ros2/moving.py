"""Messages of where the robot is, where it was told to go, and where it plans to."""

from collections.abc import Sequence
from math import cos, radians, sin
from typing import Final

import numpy as np
from khepera_protocol.text import quoted
from khepera_protocol.zenoh.controller_payloads import Decision
from khepera_protocol.zenoh.payloads import Pose
from rosbags.typesys.stores import ros2_jazzy as ros

from macor_hil.commands import COMMANDS
from macor_hil.errors import TelemetryError
from macor_hil.hardware.driver import DriveSettings
from macor_hil.hardware.robots.form import Form
from macor_hil.telemetry.ros2.messages import Frames, header, heading, pose, twist, vector

_SHORTEST: Final = 0.001
"""Seconds between two poses at least, for a speed."""

_UNKNOWN: Final = np.zeros(36)
"""Covariance: all zero says that nobody knows, as the ROS message definitions have it."""

_CAMERA_HEIGHT: Final = 0.06
"""Metres of the omnidirectional camera above the floor (docs/pictures.md)."""

Timed = tuple[float, Pose]
"""A time in seconds of the robot's clock, and a pose."""


def odometry(
    now: Timed, before: Timed | None, time: int, frames: Frames
) -> ros.nav_msgs__msg__Odometry:
    """Return the pose by odometry, and the mean speed since the one before.

    Args:
        now: the pose.
        before: an earlier one of the same drive; None: there is none, and no speed.
        time: for the header.
        frames: their names.
    """
    return ros.nav_msgs__msg__Odometry(
        header(time, frames.odometry),
        frames.body,
        ros.geometry_msgs__msg__PoseWithCovariance(pose(now[1]), _UNKNOWN),
        ros.geometry_msgs__msg__TwistWithCovariance(twist(*_mean_speed(now, before)), _UNKNOWN),
    )


def command(
    decision: Decision, time: int, frames: Frames, drive: DriveSettings | None = None
) -> ros.geometry_msgs__msg__TwistStamped:
    """Return the arc of a decision's command at top speed.

    Raises:
        TelemetryError: there is no such command.
    """
    settings = drive or DriveSettings()
    arc = next((each for each in COMMANDS if each.name == decision.command), None)
    if arc is None:
        raise TelemetryError(f"there is no command {quoted(decision.command)}")
    longer = arc.way + abs(arc.turn) * settings.wheels.base / 2
    seconds = longer / (settings.speed * settings.wheels.left / 0.010)
    return ros.geometry_msgs__msg__TwistStamped(
        header(time, frames.body), twist(arc.way / seconds, arc.turn / seconds)
    )


def transforms(
    origin: Pose, odometer: Pose, form: Form, radius: float, time: int, frames: Frames
) -> ros.tf2_msgs__msg__TFMessage:
    """Return the whole tree: arena, odometry, robot, its sensors and its camera.

    What never changes is told each time, too: who comes late needs nothing that was said before.

    Args:
        origin: of the odometry, in the arena.
        odometer: the robot's pose by odometry.
        form: of the robot.
        radius: of its body, metres.
        time: for the headers.
        frames: their names.
    """

    def placed(
        parent: str, child: str, place: Pose, height: float = 0.0
    ) -> ros.geometry_msgs__msg__TransformStamped:
        transform = ros.geometry_msgs__msg__Transform(
            vector(place.x, place.y, height), heading(place.heading)
        )
        return ros.geometry_msgs__msg__TransformStamped(header(time, parent), child, transform)

    bearings = [radians(bearing) for bearing in form.bearings]
    ring = [
        Pose(x=radius * cos(bearing), y=radius * sin(bearing), heading=bearing)
        for bearing in bearings
    ]
    return ros.tf2_msgs__msg__TFMessage(
        [
            placed(frames.world, frames.odometry, origin),
            placed(frames.odometry, frames.body, odometer),
            placed(frames.body, frames.camera, Pose(x=0.0, y=0.0, heading=0.0), _CAMERA_HEIGHT),
            *(
                placed(frames.body, frames.sensor(number), place, form.sensor_height)
                for number, place in enumerate(ring)
            ),
        ]
    )


def path(way: Sequence[Pose], time: int, frames: Frames) -> ros.nav_msgs__msg__Path:
    """Return a way, from pose to pose."""
    return ros.nav_msgs__msg__Path(
        header(time, frames.odometry),
        [
            ros.geometry_msgs__msg__PoseStamped(header(time, frames.odometry), pose(place))
            for place in way
        ],
    )


def _mean_speed(now: Timed, before: Timed | None) -> tuple[float, float]:
    """Return forward m/s and rad/s between two poses."""
    if before is None:
        return 0.0, 0.0
    (then, last), (when, here) = before, now
    seconds = when - then
    if seconds < _SHORTEST:
        return 0.0, 0.0
    turn = here.heading - last.heading
    middle = last.heading + turn / 2
    way = (here.x - last.x) * cos(middle) + (here.y - last.y) * sin(middle)
    return way / seconds, turn / seconds
