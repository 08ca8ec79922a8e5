"""An arena as a drawing from above, for those who watch."""

from math import cos, pi, sin

from khepera_emulator.arena import Arena
from khepera_emulator.geometry import wall_boxes
from khepera_emulator.models import Model
from khepera_emulator.places import pose_of
from protocol.side_channel import Outline, Solid

_POST_CORNERS = 32


def outline(arena: Arena, model: Model) -> Outline:
    """Everything that stands in an arena, with the size of the robot that drives in it."""
    walls = [
        Solid(corners=box.corners(), colour=box.colour)
        for wall in arena.wall
        for box in wall_boxes(wall)
    ]
    posts = [
        Solid(corners=_circle(post.centre, post.radius), colour=post.colour)
        for post in arena.cylinder
    ]
    return Outline(
        title=arena.title,
        floor=arena.floor,
        solids=walls + posts,
        start=pose_of(arena.start),
        robot_radius=model.radius,
    )


def _circle(centre: tuple[float, float], radius: float) -> list[tuple[float, float]]:
    angles = [2 * pi * k / _POST_CORNERS for k in range(_POST_CORNERS)]
    return [(centre[0] + radius * cos(a), centre[1] + radius * sin(a)) for a in angles]
