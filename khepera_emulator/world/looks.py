"""Shapes and colours of what cameras see beside high walls: things, robots, bulbs, low walls."""

from math import hypot
from typing import NamedTuple

from khepera_emulator.arenas.arena import Arena, Colour, Movable
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.solids import Box, Brick, Disc

BULB_RADIUS, BULB_HEIGHT = 0.012, 0.075
"""Radius of a lamp's bulb, and height of its middle above the floor, in metres (a choice)."""

BULB_COLOUR = (1.0, 0.95, 0.7)


class Block(NamedTuple):
    """An upright box: middle, unit vector along its length, half sizes, from bottom to top."""

    x: float
    y: float
    ux: float
    uy: float
    half_length: float
    half_thickness: float
    bottom: float
    top: float
    colour: Colour

    @property
    def reach(self) -> float:
        """Radius of a circle around it, seen from above."""
        return hypot(self.half_length, self.half_thickness)


class Drum(NamedTuple):
    """An upright cylinder, from bottom to top."""

    x: float
    y: float
    radius: float
    bottom: float
    top: float
    colour: Colour

    @property
    def reach(self) -> float:
        """Radius of a circle around it, seen from above."""
        return self.radius


class Ball(NamedTuple):
    """A sphere."""

    x: float
    y: float
    z: float
    radius: float
    colour: Colour

    @property
    def reach(self) -> float:
        """Radius of a circle around it, seen from above."""
        return self.radius


Look = Block | Drum | Ball


def thing_look(part: Movable, footprint: Disc | Brick) -> Look:
    """Return what a thing looks like where it is."""
    if isinstance(footprint, Brick):
        return Block(*_level(footprint), 0.0, part.height, part.colour)
    place = footprint.x, footprint.y
    if part.shape == "ball":
        return Ball(*place, footprint.radius, footprint.radius, part.colour)
    return Drum(*place, footprint.radius, 0.0, part.height, part.colour)


def plan_looks(arena: Arena, plan: FloorPlan, but: float | None) -> list[Look]:
    """Return what an arena's walls, posts and bulbs look like.

    Args:
        arena: what stands and hangs in it.
        plan: the same, from above.
        but: height of walls and posts that are left out.
    """
    looks: list[Look] = [
        Block(*_level(box), 0.0, box.height, box.colour) for box in plan.boxes if box.height != but
    ]
    looks += [
        Drum(*post.centre, post.radius, 0.0, post.height, post.colour)
        for post in arena.cylinder
        if post.height != but
    ]
    looks += [Ball(*lamp.centre, BULB_HEIGHT, BULB_RADIUS, BULB_COLOUR) for lamp in arena.lamp]
    return looks


def _level(box: Box | Brick) -> tuple[float, float, float, float, float, float]:
    return box.x, box.y, box.ux, box.uy, box.half_length, box.half_thickness
