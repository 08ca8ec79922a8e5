"""Where a robot may be put down: a pose with room for it, or any along the free strip."""

from collections.abc import Callable
from math import atan2, cos, hypot, radians, sin

import numpy as np

from khepera_emulator.arena import Corridor, Start
from khepera_emulator.errors import EmulatorError
from protocol.side_channel import Pose

_TRIES = 10_000

Gap = Callable[[Pose], float]
"""Distance in metres from a robot's body, at a pose, to the nearest thing."""


def pose_of(start: Start) -> Pose:
    """A start as a pose, in radians."""
    return Pose(x=start.x, y=start.y, heading=radians(start.heading))


def check_room(pose: Pose, gap: Gap) -> None:
    """See that a robot fits.

    Raises:
        EmulatorError: it does not.
    """
    if gap(pose) <= 0.0:
        raise EmulatorError(
            f"no room for the robot at x={pose.x:.3f} m, y={pose.y:.3f} m: something is there"
        )


def random_pose(free: Corridor, gap: Gap, rng: np.random.Generator) -> Pose:
    """A pose drawn evenly along the free strip, `free.gap` or more from everything.

    Raises:
        EmulatorError: none was found.
    """
    points = np.array(free.points)
    stretches = np.diff(points, axis=0)
    lengths = np.hypot(*stretches.T)
    for _ in range(_TRIES):
        along, aside, turn = rng.uniform([0, -1, -1], [lengths.sum(), 1, 1])
        k = min(int(np.searchsorted(np.cumsum(lengths), along)), len(lengths) - 1)
        along -= lengths[:k].sum()
        ux, uy = stretches[k] / hypot(*stretches[k])
        aside *= free.half_width
        heading = atan2(uy, ux) + turn * radians(free.heading_spread)
        pose = Pose(
            x=float(points[k][0] + along * ux - aside * uy),
            y=float(points[k][1] + along * uy + aside * ux),
            heading=atan2(sin(heading), cos(heading)),
        )
        if gap(pose) >= free.gap:
            return pose
    raise EmulatorError("no free place for a robot found along the arena's free strip")
