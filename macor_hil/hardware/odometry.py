"""Odometry: where the robot takes itself to be, from its encoder counts alone."""

from dataclasses import dataclass
from math import cos, sin
from typing import Annotated

from khepera_protocol.serial.units import PULSE, WHEEL_BASE
from khepera_protocol.zenoh.payloads import Pose
from pydantic import Field

_Count = Annotated[float, Field(ge=PULSE / 2, le=PULSE * 2)]
_Base = Annotated[float, Field(ge=WHEEL_BASE / 2, le=WHEEL_BASE * 2)]


@dataclass(frozen=True, slots=True)
class Wheels:
    """Meaning of the counts of a robot's wheels; `macor-hil calibrate` measures it.

    Attributes:
        left, right: metres a count; in files at most a factor of two from the nominal value.
        base: metres between the wheels; likewise.
    """

    left: _Count = PULSE
    right: _Count = PULSE
    base: _Base = WHEEL_BASE

    def counts(self, way: float, turn: float) -> tuple[float, float]:
        """Return counts of both wheels for an arc of a length in metres that turns by radians."""
        half = turn * self.base / 2
        return (way - half) / self.left, (way + half) / self.right


def integrate(
    pose: Pose, before: tuple[float, float], after: tuple[float, float], wheels: Wheels = Wheels()
) -> Pose:
    """Return the pose after both wheels went on from one counter reading to another.

    The way between two readings is taken as one arc.

    Args:
        pose: the pose at the first reading.
        before: counters then, left and right.
        after: counters now.
        wheels: what counts mean.
    """
    left = (after[0] - before[0]) * wheels.left
    right = (after[1] - before[1]) * wheels.right
    way, turn = (left + right) / 2, (right - left) / wheels.base
    half = turn / 2
    chord = way * (sin(half) / half if abs(half) > 1e-9 else 1.0)
    return Pose(
        x=pose.x + chord * cos(pose.heading + half),
        y=pose.y + chord * sin(pose.heading + half),
        heading=pose.heading + turn,
    )
