"""Odometry: where the robot takes itself to be, from its encoder counts alone."""

from math import cos, sin

from protocol.side_channel import Pose


def integrate(
    pose: Pose,
    before: tuple[int, int],
    after: tuple[int, int],
    *,
    pulse: float,
    wheel_base: float,
) -> Pose:
    """The pose after both wheels went on from one counter reading to another.

    The way between two readings is taken as one arc.

    Args:
        pose: the pose at the first reading.
        before: counters then, left and right.
        after: counters now.
        pulse: metres a count.
        wheel_base: metres between the wheels.
    """
    left, right = ((after[side] - before[side]) * pulse for side in (0, 1))
    way, turn = (left + right) / 2, (right - left) / wheel_base
    half = turn / 2
    chord = way * (sin(half) / half if abs(half) > 1e-9 else 1.0)
    return Pose(
        x=pose.x + chord * cos(pose.heading + half),
        y=pose.y + chord * sin(pose.heading + half),
        heading=pose.heading + turn,
    )
