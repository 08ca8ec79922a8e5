"""Messages of what the robot senses: pictures, infrared, battery."""

from collections.abc import Sequence
from math import inf, nan, pi, radians
from typing import Final

import numpy as np
from khepera_protocol.serial.commands import SENSOR_BEARINGS
from khepera_protocol.serial.units import ADC_FULL_SCALE, BODY_RADIUS
from rosbags.typesys.stores import ros2_jazzy as ros

from macor_hil.telemetry.ros2.messages import Frames, header
from macor_hil.telemetry.viewers.distances import FARTHEST, FIELD_OF_VIEW, NEAREST, distance

_BEAMS: Final = 72
"""Beams of a scan: one each five degrees, so that each sensor's axis is one."""

_HALF_BEAMS: Final = 2
"""Beams beside its axis that a sensor answers for: as many as leave neighbours apart."""

_COUNTS: Final = 1024
_CELLS: Final = 4
_DIVIDER: Final = 2.0
"""A/D input 0 gets half of the battery's voltage; a choice of the emulator's (khepera-choices)."""


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


def ranges(readings: Sequence[int], time: int, frames: Frames) -> list[ros.sensor_msgs__msg__Range]:
    """Return what each sensor sees, in the order of N; +inf: nothing within its reach."""
    return [
        ros.sensor_msgs__msg__Range(
            header(time, frames.sensor(number)),
            ros.sensor_msgs__msg__Range.INFRARED,
            FIELD_OF_VIEW,
            NEAREST,
            FARTHEST,
            _metres(reading),
            0.0,
        )
        for number, reading in enumerate(readings)
    ]


def scan(readings: Sequence[int], time: int, frames: Frames) -> ros.sensor_msgs__msg__LaserScan:
    """Return the same as a scan around the robot's middle; NaN where no sensor looks."""
    beams = np.full(_BEAMS, nan, np.float32)
    step = 2 * pi / _BEAMS
    for bearing, reading in zip(SENSOR_BEARINGS, readings, strict=True):
        middle = round((radians(bearing) + pi) / step)
        for beam in range(middle - _HALF_BEAMS, middle + _HALF_BEAMS + 1):
            beams[beam % _BEAMS] = np.fmin(beams[beam % _BEAMS], BODY_RADIUS + _metres(reading))
    return ros.sensor_msgs__msg__LaserScan(
        header(time, frames.body),
        -pi,
        pi - step,
        step,
        0.0,
        0.0,
        BODY_RADIUS + NEAREST,
        BODY_RADIUS + FARTHEST,
        beams,
        np.zeros(0, np.float32),
    )


def battery(counts: int, time: int, frames: Frames) -> ros.sensor_msgs__msg__BatteryState:
    """Return the battery's voltage from counts of A/D input 0; nothing else of it is known."""
    kind = ros.sensor_msgs__msg__BatteryState
    volts = counts * _DIVIDER * ADC_FULL_SCALE / _COUNTS
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
        kind.POWER_SUPPLY_TECHNOLOGY_NICD,
        True,
        np.full(_CELLS, nan, np.float32),
        np.full(_CELLS, nan, np.float32),
        "",
        "",
    )


def _metres(reading: int) -> float:
    seen = distance(reading)
    return inf if seen is None else seen
