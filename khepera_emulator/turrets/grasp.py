"""Things between a gripper's fingers in a PyBullet world: some stand fast, some can be lifted."""

from math import hypot

import numpy as np

from khepera_emulator.turrets.turret import Piece, Point
from khepera_emulator.world.floor_plan import Scene
from khepera_emulator.world.rays import Array
from khepera_emulator.world.world import World

SOLID_RESISTIVITY = 128
"""Reading of a solid, whose material no arena tells (a choice)."""


class WorldThings:
    """The things of a world, as the gripper of one robot finds them.

    A lifted thing is over the heads of sensors and bodies: rays and robots pass below it, and
    cameras see it in front of its robot.

    Args:
        world: where the things are.
        scene: what rays of this robot hit.
    """

    def __init__(self, world: World, scene: Scene) -> None:
        self._world = world
        self._scene = scene

    def between(self, left: Point, right: Point, /) -> Piece | None:
        """Find what two rays, one from each point towards the other, enclose."""
        ends = np.array([left, right])
        span = hypot(*(ends[1] - ends[0]))
        along = (ends[1] - ends[0]) / span
        rays = np.stack([along, -along])
        distances, _ = self._scene.cast(ends, rays)
        width = span - float(distances.sum())
        if width <= 0.0:
            return None
        number = self._hit(ends[:1], rays[:1], float(distances[0]))
        if number is None:
            return Piece(None, width, SOLID_RESISTIVITY)
        return Piece(number, width, self._world.things[number].part.resistivity)

    def lift(self, piece: Piece, /) -> bool:
        """Take a thing off the floor; False if it stands fast."""
        if piece.number is None:
            return False
        thing = self._world.things[piece.number]
        self._world.lift(thing)
        return True

    def carry(self, piece: Piece, place: Point, /) -> None:
        """Take a lifted thing along to a place, in metres."""
        if piece.number is not None:
            self._world.things[piece.number].place(*place)

    def put(self, piece: Piece, place: Point, /) -> None:
        """Put a lifted thing down at a place, in metres."""
        if piece.number is None:
            return
        thing = self._world.things[piece.number]
        thing.place(*place)
        self._world.put(thing)

    def _hit(self, origins: Array, directions: Array, distance: float) -> int | None:
        """Return the number of the thing that a ray reaches at a distance in metres."""
        for number, thing in enumerate(self._world.things):
            # the very number that the scene, which knows only what is on the floor, has given
            if thing.footprint.hit(origins, directions)[0] == distance:
                return number
        return None
