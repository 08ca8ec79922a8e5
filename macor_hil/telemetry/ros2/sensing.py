"""Messages of what the robot senses: pictures, infrared, battery."""

from collections.abc import Sequence
from math import inf, nan, pi, radians
from typing import Final

import numpy as np
from rosbags.typesys.stores import ros2_jazzy as ros

from macor_hil.hardware.robots.form import Form
from macor_hil.telemetry.ros2.messages import Frames, header

_BEAMS: Final = 72
"""Beams of a scan: one each five degrees, so that each sensor's axis is one."""

_HALF_BEAMS: Final = 2
"""Beams beside its axis that a sensor answers for: as many as leave neighbours apart."""

_CHEMISTRIES: Final = {
    "NICD": ros.sensor_msgs__msg__BatteryState.POWER_SUPPLY_TECHNOLOGY_NICD,
    "LIPO": ros.sensor_msgs__msg__BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO,
}


def image(
    picture: bytes, form: str, time: int, frames: Frames
) -> ros.sensor_msgs__msg__CompressedImage:
    """Return an encoded picture as it is; its form is jpeg or png."""
    data = np.frombuffer(picture, np.uint8)
    return ros.sensor_msgs__msg__CompressedImage(header(time, frames.camera), form, data)


def camera_info(
    width: int, height: int, time: int, frames: Frames
) -> ros.sensor_msgs__msg__CameraInfo:
    """Return a picture's size. A mirror's picture has no pinhole model: K is zero, uncalibrated."""
    return ros.sensor_msgs__msg__CameraInfo(
        header(time, frames.camera),
        height,
        width,
        "",
        np.zeros(0),
        np.zeros(9),
        np.zeros(9),
        np.zeros(12),
        0,
        0,
        ros.sensor_msgs__msg__RegionOfInterest(0, 0, 0, 0, False),
    )


def ranges(
    readings: Sequence[int], form: Form, time: int, frames: Frames
) -> list[ros.sensor_msgs__msg__Range]:
    """Return what each sensor sees, in the driver's order; +inf: nothing within its reach."""
    return [
        ros.sensor_msgs__msg__Range(
            header(time, frames.sensor(number)),
            ros.sensor_msgs__msg__Range.INFRARED,
            form.field_of_view,
            form.nearest,
            form.farthest,
            _metres(reading, form),
            0.0,
        )
        for number, reading in enumerate(readings)
    ]


def scan(
    readings: Sequence[int], form: Form, radius: float, time: int, frames: Frames
) -> ros.sensor_msgs__msg__LaserScan:
    """Return the same as a scan around the robot's middle; NaN where no sensor looks."""
    beams = np.full(_BEAMS, nan, np.float32)
    step = 2 * pi / _BEAMS
    for bearing, reading in zip(form.bearings, readings, strict=True):
        middle = round((radians(bearing) + pi) / step)
        for beam in range(middle - _HALF_BEAMS, middle + _HALF_BEAMS + 1):
            seen = radius + _metres(reading, form)
            beams[beam % _BEAMS] = np.fmin(beams[beam % _BEAMS], seen)
    return ros.sensor_msgs__msg__LaserScan(
        header(time, frames.body),
        -pi,
        pi - step,
        step,
        0.0,
        0.0,
        radius + form.nearest,
        radius + form.farthest,
        beams,
        np.zeros(0, np.float32),
    )


def battery(
    volts: float, form: Form, time: int, frames: Frames
) -> ros.sensor_msgs__msg__BatteryState:
    """Return the battery's voltage; nothing else of it is known."""
    kind = ros.sensor_msgs__msg__BatteryState
    return kind(
        header(time, frames.body),
        volts,
        nan,
        nan,
        nan,
        nan,
        nan,
        nan,
        kind.POWER_SUPPLY_STATUS_DISCHARGING,
        kind.POWER_SUPPLY_HEALTH_UNKNOWN,
        _CHEMISTRIES[form.chemistry],
        True,
        np.full(form.cells, nan, np.float32),
        np.full(form.cells, nan, np.float32),
        "",
        "",
    )


def _metres(reading: int, form: Form) -> float:
    seen = form.distance(reading)
    return inf if seen is None else seen
