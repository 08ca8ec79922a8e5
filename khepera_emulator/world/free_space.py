"""Places to put a robot down: a pose with room for it, or any along the free strip."""

from collections.abc import Callable
from math import atan2, cos, hypot, pi, radians, sin

import numpy as np
from khepera_protocol.zenoh.payloads import Pose

from khepera_emulator.arenas.arena import FARTHEST, Corridor, Start
from khepera_emulator.errors import EmulatorError

_TRIES = 10_000

Gap = Callable[[Pose], float]
"""Distance in metres from a robot's body, at a pose, to the nearest thing."""


Inside = Callable[[float, float], bool]
"""Tells whether a place in metres is inside the walls."""


def anywhere(_x: float, _y: float) -> bool:
    """Tell that a place is inside: there are no walls."""
    return True


def pose_of(start: Start) -> Pose:
    """Return a start as a pose, in radians."""
    return Pose(x=start.x, y=start.y, heading=radians(start.heading))


def check_room(pose: Pose, gap: Gap, inside: Inside = anywhere, what: str = "the robot") -> None:
    """See that a robot, or a thing, can be put down at a pose.

    Args:
        pose: where.
        gap: room that there is.
        inside: tells which places are inside the walls.
        what: is put down, for the error.

    Raises:
        EmulatorError: it is beyond all bounds, outside the walls, or something is there.
    """
    place = f"x={pose.x:.3f} m, y={pose.y:.3f} m"
    # written so that what is not a number is refused, too
    if not (abs(pose.x) <= FARTHEST and abs(pose.y) <= FARTHEST):
        raise EmulatorError(
            f"x={pose.x:g} m, y={pose.y:g} m is in no arena: they end {FARTHEST:g} m from their"
            " origin"
        )
    if not abs(pose.heading) <= 2 * pi:
        raise EmulatorError(
            f"the heading {pose.heading:g} is not an angle from {-2 * pi:.3f} to {2 * pi:.3f}"
            " radians"
        )
    if not inside(pose.x, pose.y):
        raise EmulatorError(f"{place} is outside the walls of the arena")
    if gap(pose) <= 0.0:
        raise EmulatorError(f"no room for {what} at {place}: something is there")


def random_pose(
    free: Corridor, gap: Gap, rng: np.random.Generator, inside: Inside = anywhere
) -> Pose:
    """Draw a pose evenly along the free strip, `free.gap` or more from everything.

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
        if gap(pose) >= free.gap and inside(pose.x, pose.y):
            return pose
    raise EmulatorError("no free place for a robot found along the arena's free strip")
