"""An arena as a drawing from above, for those who watch."""

from math import cos, pi, radians, sin

from khepera_emulator.arena import Arena
from khepera_emulator.geometry import Box, wall_boxes
from khepera_emulator.models import Model
from protocol.side_channel import Outline, Pose, Solid

_POST_CORNERS = 32


def outline(arena: Arena, model: Model) -> Outline:
    """Everything that stands in an arena, with the size of the robot that drives in it."""
    walls = [_box(box) for wall in arena.wall for box in wall_boxes(wall)]
    posts = [
        Solid(corners=_circle(post.centre, post.radius), colour=post.colour)
        for post in arena.cylinder
    ]
    start = arena.start
    return Outline(
        title=arena.title,
        floor=arena.floor,
        solids=walls + posts,
        start=Pose(x=start.x, y=start.y, heading=radians(start.heading)),
        robot_radius=model.radius,
    )


def _box(box: Box) -> Solid:
    corners = [
        (
            box.x + along * box.half_length * box.ux - across * box.half_thickness * box.uy,
            box.y + along * box.half_length * box.uy + across * box.half_thickness * box.ux,
        )
        for along, across in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return Solid(corners=corners, colour=box.colour)


def _circle(centre: tuple[float, float], radius: float) -> list[tuple[float, float]]:
    angles = [2 * pi * k / _POST_CORNERS for k in range(_POST_CORNERS)]
    return [(centre[0] + radius * cos(a), centre[1] + radius * sin(a)) for a in angles]
