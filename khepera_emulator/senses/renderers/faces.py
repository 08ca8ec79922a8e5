"""PyBullet's renderer looking four ways: the reference that the emulator's own is tested against.

Four faces of 90 degrees lie side by side in one atlas. Floor and sky are even in colour, so that
the rows below and above the horizon are painted first and the renderer, which takes 0.3 us for
every pixel that something covers, draws only what stands on the floor.
"""

from math import cos, pi, sin, tan

import cv2
import numpy as np
import pybullet
from khepera_protocol.zenoh.payloads import Pose

from khepera_emulator.body.rigid_body import RigidBody
from khepera_emulator.senses.renderers.view import (
    AMBIENT,
    DIFFUSE,
    LIGHT,
    Grid,
    Image,
    floor_colour,
    sky_colour,
)
from khepera_emulator.world.world import World

_FACES = 4


class FacesRenderer:
    """Four pictures of PyBullet's, with a robot's own body left out.

    Args:
        world: what is seen; it has dynamics.
        height: metres of the viewpoint above the floor.
        low, high: elevations in radians that the atlas must show.
        resolution: pixels across each face.
        own: the body of the robot that carries the camera, and is not seen by it.
    """

    def __init__(
        self,
        world: World,
        height: float,
        low: float,
        high: float,
        resolution: int = 64,
        own: RigidBody | None = None,
    ) -> None:
        assert world.dynamics is not None
        self._world = world
        self._client = world.dynamics.client
        self._own = own
        self._height = height
        self._size = resolution
        # 20 degrees up seen along the edge of a face lie higher in it than in its middle
        corner = 1.0 / cos(pi / 4)
        self._top = tan(high) * corner
        self._bottom = tan(low) * corner
        self._rows = round(resolution * (self._top - self._bottom) / 2)
        near = 0.01
        self._projection = pybullet.computeProjectionMatrix(
            -near, near, self._bottom * near, self._top * near, near, 5.0
        )
        self._background = self._empty_atlas()

    def render(self, pose: Pose) -> Image:
        """Return the atlas of the four faces, ahead, left, behind, right."""
        for robot in self._world.robots:
            robot.show()
        if self._own is None:
            return self._draw(pose)
        self._own.paint(visible=False)
        atlas = self._draw(pose)
        self._own.paint(visible=True)
        return atlas

    def _draw(self, pose: Pose) -> Image:
        atlas = self._background.copy()
        for face in range(_FACES):
            azimuth = pose.heading + face * pi / 2
            view = pybullet.computeViewMatrix(
                (pose.x, pose.y, self._height),
                (pose.x + cos(azimuth), pose.y + sin(azimuth), self._height),
                (0.0, 0.0, 1.0),
            )
            _, _, pixels, _, body = pybullet.getCameraImage(
                self._size,
                self._rows,
                view,
                self._projection,
                shadow=0,
                lightDirection=LIGHT,
                lightAmbientCoeff=AMBIENT,
                lightDiffuseCoeff=DIFFUSE,
                lightSpecularCoeff=0.0,
                renderer=pybullet.ER_TINY_RENDERER,
                flags=0,
                physicsClientId=self._client,
            )
            part = atlas[:, face * self._size : (face + 1) * self._size]
            # a PyBullet that was built without NumPy hands out flat tuples
            colours = np.asarray(pixels, np.uint8).reshape(self._rows, self._size, 4)
            solid = np.asarray(body, np.int32).reshape(self._rows, self._size) >= 0
            cv2.copyTo(cv2.cvtColor(colours, cv2.COLOR_RGBA2BGR), solid.view(np.uint8), part)
        return atlas

    def place(self, azimuth: Grid, elevation: Grid) -> tuple[Grid, Grid]:
        """Return column and row of directions in the atlas; see `Renderer.place`."""
        face = np.floor(azimuth / (pi / 2) + 0.5)
        within = azimuth - face * (pi / 2)
        u = -np.tan(within)  # left of the axis is positive azimuth
        v = np.tan(elevation) / np.cos(within)
        # no blending across the edge of a face, whose neighbour in the atlas is another view
        column = np.clip((u + 1) / 2 * self._size - 0.5, 0, self._size - 1)
        column += face % _FACES * self._size
        row = (self._top - v) / (self._top - self._bottom) * self._rows - 0.5
        return column, np.clip(row, 0, self._rows - 1)

    def _empty_atlas(self) -> Image:
        """Return the atlas of an empty arena: floor up to the horizon, sky above it."""
        arena = self._world.arena
        horizon = self._top / (self._top - self._bottom) * self._rows
        atlas = np.empty((self._rows, _FACES * self._size, 3), np.uint8)
        above = np.arange(self._rows) + 0.5 < horizon
        atlas[above] = sky_colour(arena.sky)
        atlas[~above] = floor_colour(arena.floor)
        return atlas
