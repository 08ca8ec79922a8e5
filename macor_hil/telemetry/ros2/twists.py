"""Twists that other nodes send: read from CDR, bounded, and only the latest one kept."""

import struct
import time
from collections.abc import Callable, Iterator
from math import isfinite
from queue import Empty, SimpleQueue
from typing import Final, NamedTuple

import zenoh
from rosbags.typesys.stores import ros2_jazzy as ros

from macor_hil.telemetry.ros2.messages import topic_of
from macor_hil.telemetry.ros2.rmw_zenoh import Topic

_HEAD: Final = b"\x00\x01"
"""Beginning of CDR, little-endian; two bytes of options follow."""

_START: Final = 4
_TWIST: Final = struct.Struct("<6d")
_STAMP: Final = struct.Struct("<iII")
"""Seconds, nanoseconds, and the length of the frame's name, which follows."""

_LONGEST: Final = 512
_MOST: Final = 100.0
"""m/s and rad/s beyond which a twist is no robot's."""


class Twist(NamedTuple):
    """A motion that a robot is told to make.

    Attributes:
        forward: m/s.
        turning: rad/s, to the left.
        came: when, seconds of the monotonic clock.
    """

    forward: float
    turning: float
    came: float


def read_twist(data: bytes, *, stamped: bool) -> tuple[float, float] | None:
    """Return forward m/s and rad/s of a Twist or TwistStamped; None where it is none.

    What a robot on two wheels cannot do (to the side, upwards) does not count.
    """
    if len(data) > _LONGEST or data[:2] != _HEAD:
        return None
    body, at = data[_START:], 0
    if stamped:
        if len(body) < _STAMP.size:
            return None
        at = _STAMP.size + _STAMP.unpack_from(body)[2]
        at += -at % 8
    if len(body) != at + _TWIST.size:
        return None
    forward, _, _, _, _, turning = values = _TWIST.unpack_from(body, at)
    if not all(isfinite(value) and abs(value) <= _MOST for value in values):
        return None
    return forward, turning


class Twists:
    """The twists that are sent to one topic, of both types.

    Args:
        namespace: of the robot.

    Attributes:
        refused: how many could not be read.
    """

    def __init__(self, namespace: str) -> None:
        self.refused = 0
        self._name = f"{namespace}/cmd_vel"
        self._came: SimpleQueue[Twist] = SimpleQueue()

    def heard(self) -> Iterator[tuple[Topic, Callable[[zenoh.Sample], None]]]:
        """Yield the topics, each with what takes its samples."""
        yield topic_of(self._name, ros.geometry_msgs__msg__Twist), self._take
        yield topic_of(self._name, ros.geometry_msgs__msg__TwistStamped), self._take_stamped

    def latest(self) -> Twist | None:
        """Return the latest one since the last call."""
        twist = None
        while True:
            try:
                twist = self._came.get_nowait()
            except Empty:
                return twist

    def _take(self, sample: zenoh.Sample) -> None:
        self._put(read_twist(sample.payload.to_bytes(), stamped=False))

    def _take_stamped(self, sample: zenoh.Sample) -> None:
        self._put(read_twist(sample.payload.to_bytes(), stamped=True))

    def _put(self, motion: tuple[float, float] | None) -> None:
        if motion is None:
            self.refused += 1
        else:
            self._came.put(Twist(*motion, time.monotonic()))
