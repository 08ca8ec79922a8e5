"""Solids on the floor, one by one and seen from above: boxes and discs.

Plain numbers instead of arrays: a body or a sensor has one or two of these within its reach, and
for so few NumPy's calls cost more than the arithmetic.
"""

from dataclasses import dataclass, field
from math import cos, hypot, inf, pi, radians, sin, sqrt
from typing import Protocol

import numpy as np

from khepera_emulator.arenas.arena import Movable, Point, Wall
from khepera_emulator.world.rays import NEVER, Array, to_boxes, to_discs

_DISC_CORNERS = 32
_GLANCE = 1.0 / NEVER


class Solid(Protocol):
    """Something convex and upright that stands on the floor."""

    @property
    def grey(self) -> float:
        """Brightness to infrared, 0 to 1."""

    def gap(self, x: float, y: float) -> float:
        """Return the distance in metres from a point to its surface; 0 or less inside."""

    def toward(self, x: float, y: float) -> tuple[float, float, float]:
        """Return the same, and the unit vector from a point at it; inside: deeper into it."""

    def ray(self, x: float, y: float, dx: float, dy: float) -> float:
        """Return metres that a ray from a point goes to reach it, infinite if it misses.

        The ray's direction is a unit vector; from inside it reaches it at once.
        """


class Footprint(Solid, Protocol):
    """Something that may stand elsewhere in the next moment.

    Attributes:
        x, y: its middle, in metres.
        reach: metres that it may move in the next control period.
    """

    x: float
    y: float
    reach: float

    def corners(self) -> list[Point]:
        """Return corners around it, in metres."""

    def hit(self, origins: Array, directions: Array) -> Array:
        """Return metres that each of N rays goes to reach it, infinite if it misses."""


class _Rectangle:
    """A rectangle: centre, unit vector along its length, half length and half thickness."""

    __slots__ = ()

    x: float
    y: float
    ux: float
    uy: float
    half_length: float
    half_thickness: float

    def gap(self, x: float, y: float) -> float:
        """Return the distance in metres from a point to its surface; 0 or less inside."""
        dx, dy, ux, uy = x - self.x, y - self.y, self.ux, self.uy
        along = abs(dx * ux + dy * uy) - self.half_length
        across = abs(dy * ux - dx * uy) - self.half_thickness
        if along <= 0.0 or across <= 0.0:
            return along if along > across else across
        return hypot(along, across)

    def toward(self, x: float, y: float) -> tuple[float, float, float]:
        """Return the same, and the unit vector from a point at it; inside: deeper into it."""
        dx, dy, ux, uy = self.x - x, self.y - y, self.ux, self.uy
        ahead, aside = dx * ux + dy * uy, dy * ux - dx * uy
        along, across = abs(ahead) - self.half_length, abs(aside) - self.half_thickness
        if along <= 0.0 or across <= 0.0:
            # straight before a face, or inside
            if along > across:
                gap, along, across = along, (1.0 if ahead > 0.0 else -1.0), 0.0
            else:
                gap, along, across = across, 0.0, (1.0 if aside > 0.0 else -1.0)
        else:
            gap = hypot(along, across)
            along, across = (
                (along if ahead > 0.0 else -along) / gap,
                (across if aside > 0.0 else -across) / gap,
            )
        return gap, along * ux - across * uy, along * uy + across * ux

    def ray(self, x: float, y: float, dx: float, dy: float) -> float:
        """Return metres that a ray from a point goes to reach it, infinite if it misses."""
        rx, ry, ux, uy = self.x - x, self.y - y, self.ux, self.uy
        # the ways at which it crosses the lines of the ends, and those of the long faces
        inverse = 1.0 / (dx * ux + dy * uy + _GLANCE)
        middle, half = (rx * ux + ry * uy) * inverse, self.half_length * abs(inverse)
        enter, leave = middle - half, middle + half
        inverse = 1.0 / (dy * ux - dx * uy + _GLANCE)
        middle, half = (ry * ux - rx * uy) * inverse, self.half_thickness * abs(inverse)
        if middle - half > enter:
            enter = middle - half
        if middle + half < leave:
            leave = middle + half
        if enter < 0.0:
            enter = 0.0
        return enter if leave >= enter else inf

    def corners(self) -> list[Point]:
        """Return the four corners, in metres, one after the other around it."""
        ux, uy, length, width = self.ux, self.uy, self.half_length, self.half_thickness
        return [
            (self.x + a * length * ux - b * width * uy, self.y + a * length * uy + b * width * ux)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]


@dataclass(frozen=True, slots=True)
class Box(_Rectangle):
    """An upright box that stands fast: centre, unit vector along its length, half sizes, metres."""

    x: float
    y: float
    ux: float
    uy: float
    half_length: float
    half_thickness: float
    height: float
    colour: tuple[float, float, float]
    grey: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "grey", sum(self.colour) / 3)


def wall_boxes(wall: Wall) -> list[Box]:
    """Return the boxes of a wall, one a stretch, lengthened to close the corners."""
    boxes = []
    half = wall.thickness / 2
    for (x0, y0), (x1, y1) in zip(wall.points, wall.points[1:], strict=False):
        length = hypot(x1 - x0, y1 - y0)
        boxes.append(
            Box(
                (x0 + x1) / 2,
                (y0 + y1) / 2,
                (x1 - x0) / length,
                (y1 - y0) / length,
                length / 2 + half,
                half,
                wall.height,
                wall.colour,
            )
        )
    return boxes


class Disc:
    """Something round, which may move."""

    def __init__(self, x: float, y: float, radius: float, grey: float) -> None:
        self.x, self.y = x, y
        self.radius = radius
        self.grey = grey
        self.reach = 0.0

    def gap(self, x: float, y: float) -> float:
        """Return the distance in metres from a point to its surface; 0 or less inside."""
        return hypot(x - self.x, y - self.y) - self.radius

    def toward(self, x: float, y: float) -> tuple[float, float, float]:
        """Return the same, and the unit vector from a point at it; inside: deeper into it."""
        dx, dy = self.x - x, self.y - y
        distance = hypot(dx, dy)
        if distance == 0.0:
            return -self.radius, 1.0, 0.0
        return distance - self.radius, dx / distance, dy / distance

    def ray(self, x: float, y: float, dx: float, dy: float) -> float:
        """Return metres that a ray from a point goes to reach it, infinite if it misses."""
        rx, ry = self.x - x, self.y - y
        beside = rx * dy - ry * dx
        inside = self.radius**2 - beside**2
        if inside < 0.0:
            return inf
        along, half = rx * dx + ry * dy, sqrt(inside)
        if along + half < 0.0:
            return inf
        return along - half if along > half else 0.0

    def hit(self, origins: Array, directions: Array) -> Array:
        """Return metres that each of N rays goes to reach it, infinite if it misses."""
        disc = np.array([[self.x], [self.y], [self.radius]])
        distances: Array = to_discs(origins, directions, disc)[:, 0]
        return distances

    def corners(self) -> list[Point]:
        """Return corners of a polygon that is drawn for it, in metres."""
        angles = [2 * pi * k / _DISC_CORNERS for k in range(_DISC_CORNERS)]
        return [
            (self.x + self.radius * cos(angle), self.y + self.radius * sin(angle))
            for angle in angles
        ]


class Brick(_Rectangle):
    """A box that may move, its length along its heading."""

    def __init__(
        self, x: float, y: float, heading: float, size: tuple[float, float], grey: float
    ) -> None:
        self.x, self.y = x, y
        self.turn(heading)
        self.half_length, self.half_thickness = size[0] / 2, size[1] / 2
        self.grey = grey
        self.reach = 0.0

    def turn(self, heading: float) -> None:
        """Turn it to a heading in radians."""
        self.heading = heading
        self.ux, self.uy = cos(heading), sin(heading)

    def hit(self, origins: Array, directions: Array) -> Array:
        """Return metres that each of N rays goes to reach it, infinite if it misses."""
        axes = np.array([[self.ux, -self.uy], [self.uy, self.ux]])
        halves = np.array([self.half_length, self.half_thickness])
        offsets = np.array([self.x, self.y]) @ axes
        distances: Array = to_boxes(origins, directions, axes, offsets, halves)[:, 0]
        return distances


def footprint(part: Movable) -> Disc | Brick:
    """Return what a thing covers of the floor where the arena puts it."""
    x, y = part.centre
    grey = sum(part.colour) / 3
    if part.size is not None:
        return Brick(x, y, radians(part.heading), part.size, grey)
    return Disc(x, y, part.radius or 0.0, grey)
