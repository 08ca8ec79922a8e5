"""An arena as a drawing from above, for those who watch."""

from collections.abc import Iterable

from khepera_protocol.zenoh.payload_model import MOST_NAME, MOST_TITLE
from khepera_protocol.zenoh.payloads import MOST_SOLIDS, Outline, Solid

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.models import Model
from khepera_emulator.world.free_space import pose_of
from khepera_emulator.world.solids import Brick, Disc, footprint, wall_boxes


def outline(arena: Arena, model: Model, places: Iterable[Disc | Brick] | None = None) -> Outline:
    """Everything that stands in an arena, with the size of the robot that drives in it.

    Args:
        arena: what stands there.
        model: the robot.
        places: where its movable objects are, if they are not where the arena puts them.
    """
    walls = [
        Solid(corners=box.corners(), colour=box.colour)
        for wall in arena.wall
        for box in wall_boxes(wall)
    ]
    posts = [
        Solid(corners=Disc(*post.centre, post.radius, 0.0).corners(), colour=post.colour)
        for post in arena.cylinder
    ]
    if places is None:
        places = [footprint(part) for part in arena.object]
    things = [
        Solid(corners=place.corners(), colour=part.colour)
        for part, place in zip(arena.object, places, strict=True)
    ]
    solids = (walls + posts + things)[:MOST_SOLIDS]
    return Outline(
        title=arena.title[:MOST_TITLE],
        floor=arena.floor,
        solids=solids,
        start=pose_of(arena.start),
        robot_radius=model.radius,
        robot_kind=model.kind[:MOST_NAME],
        robot_model=model.name[:MOST_NAME],
        things=len(things) if len(solids) == len(walls) + len(posts) + len(things) else 0,
    )
