"""The skyline: walls and posts that stand still, as high as the highest, higher than the eye.

Seen from a point lower than all of them, the nearest solid in a direction hides whatever is behind
it, so that a column of the picture is floor, one colour of wall, and sky: all that is to be found
is how far away the first solid is, and which of its faces looks here. Most arenas are no more than
that; what stands or hangs in front of it, `foreground` paints.
"""

from math import hypot, pi
from typing import Final, NamedTuple

import cv2
import numpy as np
from khepera_protocol.system.compiled import Kernel
from khepera_protocol.zenoh.payloads import Pose
from numpy.typing import NDArray

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.senses.renderers.first_seen import FirstSeen
from khepera_emulator.senses.renderers.view import (
    AMBIENT,
    DIFFUSE,
    LIGHT,
    Grid,
    Image,
    floor_colour,
    sky_colour,
)
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.rays import Array

_PAINT: Final = Kernel("khepera_emulator.senses.renderers.columns:paint", 1_000)

_COLUMNS = 256
"""Columns of the atlas, all around: 1.4 degrees each."""

ROWS = 60

_EVERY = np.arange(_COLUMNS)

_DROP_FOURTH = cv2.COLOR_BGRA2BGR

_SUN = np.array(LIGHT[:2]) / hypot(*LIGHT)
"""The level part of the unit vector to the light: upright faces get no more of it."""


class View(NamedTuple):
    """The skyline, and where what is in front of it must be.

    Attributes:
        picture: the atlas.
        rays: unit vectors of its columns, shape (2, C).
        distances: metres to the skyline in each column, infinite where there is only sky.
        top: row of its upper edge in each column, with the fraction.
    """

    picture: Image
    rays: Array
    distances: Array
    top: Array


class Skyline:
    """Nearest solids all around, as an equirectangular atlas.

    Args:
        arena: what is seen.
        plan: the same, from above.
        height: metres of the viewpoint above the floor.
        low, high: elevations in radians that the atlas shows.

    Attributes:
        top: height of what it draws, in metres; None: nothing is higher than the viewpoint.
    """

    def __init__(
        self, arena: Arena, plan: FloorPlan, height: float, low: float, high: float
    ) -> None:
        self.top = _top(arena, height)
        boxes = [box for box in plan.boxes if box.height == self.top]
        posts = [post for post in arena.cylinder if post.height == self.top]
        round_ones = [(*post.centre, post.radius) for post in posts]
        self._solids = FirstSeen(boxes, round_ones, _SUN)
        self._high = high
        self._row = (high - low) / ROWS
        # the first column begins right behind the robot; the last one ends there
        self._bearings = pi - (np.arange(_COLUMNS) + 0.5) * (2 * pi / _COLUMNS)
        self._rise = (self.top or height) - height
        self._fall = -height
        colours = [box.colour for box in boxes] + [post.colour for post in posts]
        self._colours = np.array(colours, dtype=np.float32).reshape(-1, 3)[:, ::-1]
        self._colours = np.floor(self._colours * 255)
        if not len(self._colours):
            self._colours = np.zeros((1, 3), np.float32)
        self._floor = np.array(floor_colour(arena.floor), dtype=np.float32)
        self._sky = np.array(sky_colour(arena.sky), dtype=np.float32)
        self._packed_floor, self._packed_sky = _pack(self._floor), _pack(self._sky)
        self._middles = np.arange(ROWS)[:, None] + 0.5

    def look(self, pose: Pose) -> View:
        """Return the atlas: from behind over left, ahead and right to behind again."""
        azimuth = self._bearings + pose.heading
        rays = np.stack([np.cos(azimuth), np.sin(azimuth)])
        distances, solids, lit = self._solids.look(pose.x, pose.y, rays)
        shade = (AMBIENT + DIFFUSE * lit).astype(np.float32)
        colours = np.floor(self._colours[solids] * shade[:, None])
        # rows of the solid's upper edge and of its foot, with their fractions
        top, foot = self.row(self._rise, distances), self.row(self._fall, distances)
        picture = np.empty((ROWS, _COLUMNS, 3), np.uint8)
        arguments = picture, top, foot, colours, self._floor, self._sky
        if _PAINT.pays(*arguments):
            _PAINT(*arguments)
        else:
            picture = self._painted(top, foot, colours)
        return View(picture, rays, distances, top)

    def _painted(self, top: Array, foot: Array, colours: NDArray[np.float32]) -> Image:
        picture = np.where(
            self._middles > foot,
            self._packed_floor,
            np.where(self._middles > top, _pack(colours), self._packed_sky),
        )
        picture = cv2.cvtColor(picture.view(np.uint8).reshape(ROWS, _COLUMNS, 4), _DROP_FOURTH)
        for edge in top, foot:
            row = np.clip(edge.astype(int), 0, ROWS - 1)
            wall, floor = (np.clip(row + 1 - each, 0.0, 1.0)[:, None] for each in (top, foot))
            mixed = self._sky + wall * (colours - self._sky) + floor * (self._floor - colours)
            picture[row, _EVERY] = mixed
        return np.asarray(picture, dtype=np.uint8)

    def row(self, height: float | Array, distances: Array) -> Array:
        """Return the row, with its fraction, of what is so high above the eye and so far away."""
        return self.row_at(np.arctan(height / distances))

    def row_at(self, elevation: Array) -> Array:
        """Return the row, with its fraction, of an elevation in radians."""
        return (self._high - elevation) / self._row

    def place(self, azimuth: Grid, elevation: Grid) -> tuple[Grid, Grid]:
        """Return column and row of directions in the atlas; see `Renderer.place`."""
        column = (pi - azimuth) % (2 * pi) / (2 * pi) * _COLUMNS - 0.5
        row = (self._high - elevation) / self._row - 0.5
        return column, np.clip(row, 0, ROWS - 1)


def _pack(colours: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return colours of shape (..., 3) as one number each, which is quicker to choose from."""
    four = np.zeros((*colours.shape[:-1], 4), np.uint8)
    four[..., :3] = colours
    return four.view(np.uint32)[..., 0]


def _top(arena: Arena, height: float) -> float | None:
    heights = {wall.height for wall in arena.wall} | {post.height for post in arena.cylinder}
    top = max(heights, default=0.0)
    return top if top > height else None
