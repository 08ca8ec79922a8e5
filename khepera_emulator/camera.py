"""The omnidirectional camera: PyBullet renders four side views, one look-up makes the picture.

Four faces of 90 degrees lie side by side in one atlas; a map computed once says from where in it
every pixel of the mirror image (or of the panorama) comes. Floor and sky are even in colour, so
that the rows below and above the horizon are painted first and the renderer, which takes 0.3 us
for every pixel that something covers, draws only what stands on the floor.
"""

from functools import cache
from math import cos, hypot, pi, sin, tan

import cv2
import numpy as np
import pybullet
from numpy.typing import NDArray

from khepera_emulator.chassis import Chassis
from khepera_emulator.world import World
from protocol.mirror import Mirror
from protocol.side_channel import Pose

Image = NDArray[np.uint8]
"""Picture of shape (height, width, 3), channels in OpenCV's order blue, green, red."""

HEIGHT = 0.06
"""Metres of the mirror's viewpoint above the floor (a choice)."""

NOISE = 2.0
"""Standard deviation of the camera's noise in grey levels (a choice)."""

_FACES = 4
_NOISE_POOL = 1 << 20

_LIGHT = (0.3, 0.5, 1.0)
_AMBIENT, _DIFFUSE = 0.7, 0.3


class OmniCamera:
    """Camera on a robot's back, in the physics client of its world.

    Args:
        world: what is seen.
        rng: source of the camera's noise.
        mirror: geometry of the mirror image.
        resolution: pixels across each of the four rendered faces.
        noise: standard deviation in grey levels.
        carrier: the robot's body, which its camera does not see; others see it.
    """

    def __init__(
        self,
        world: World,
        rng: np.random.Generator,
        mirror: Mirror = Mirror(),  # noqa: B008 - an immutable value
        resolution: int = 64,
        noise: float = NOISE,
        carrier: Chassis | None = None,
    ) -> None:
        self._world = world
        # alone in a world a body has no looks
        self._carrier = carrier if world.shared else None
        self._mirror = mirror
        self._size = resolution
        # 20 degrees up seen along the edge of a face lie higher in it than in its middle
        corner = 1.0 / cos(pi / 4)
        self._top = tan(mirror.high) * corner
        self._bottom = tan(mirror.low) * corner
        self._rows = round(resolution * (self._top - self._bottom) / 2)
        near = 0.01
        self._projection = pybullet.computeProjectionMatrix(
            -near, near, self._bottom * near, self._top * near, near, 5.0
        )
        self._mirror_map = self._look_up(*_mirror_rays(mirror))
        self._panorama_map = self._look_up(*_panorama_rays(mirror))
        self._inside = _inside(mirror)
        self._background = self._empty_atlas()
        self._rng = rng
        self._noise = _noise_pool(noise) if noise > 0.0 else None

    def mirror_image(self, pose: Pose) -> Image:
        """What the camera sees in its mirror; black outside the mirror."""
        image = self._grain(self._remap(pose, self._mirror_map))
        return np.asarray(cv2.bitwise_and(image, self._inside), dtype=np.uint8)

    def panorama(self, pose: Pose) -> Image:
        """The unwrapped view: straight ahead in the middle, left at the left, up at the top."""
        return self._grain(self._remap(pose, self._panorama_map))

    def _remap(self, pose: Pose, maps: tuple[NDArray[np.int16], NDArray[np.uint16]]) -> Image:
        if self._carrier is None:
            atlas = self._render(pose)
        else:
            self._world.show_robots()
            self._carrier.paint(visible=False)
            atlas = self._render(pose)
            self._carrier.paint(visible=True)
        picture = cv2.remap(atlas, maps[0], maps[1], cv2.INTER_LINEAR)
        return np.asarray(picture, dtype=np.uint8)

    def _empty_atlas(self) -> Image:
        """The atlas of an empty arena: floor up to the horizon, sky above it."""
        arena = self._world.arena
        shade = _AMBIENT + _DIFFUSE * _LIGHT[2] / hypot(*_LIGHT)
        horizon = self._top / (self._top - self._bottom) * self._rows
        atlas = np.empty((self._rows, _FACES * self._size, 3), np.uint8)
        above = np.arange(self._rows) + 0.5 < horizon
        # as PyBullet does: a colour is a byte, and so is what light makes of it
        atlas[above] = [round(255 * share) for share in reversed(arena.sky)]
        atlas[~above] = [int(int(255 * share) * shade) for share in reversed(arena.floor)]
        return atlas

    def _render(self, pose: Pose) -> Image:
        """The atlas of the four faces, ahead, left, behind, right."""
        atlas = self._background.copy()
        for face in range(_FACES):
            azimuth = pose.heading + face * pi / 2
            view = pybullet.computeViewMatrix(
                (pose.x, pose.y, HEIGHT),
                (pose.x + cos(azimuth), pose.y + sin(azimuth), HEIGHT),
                (0.0, 0.0, 1.0),
            )
            _, _, pixels, _, body = pybullet.getCameraImage(
                self._size,
                self._rows,
                view,
                self._projection,
                shadow=0,
                lightDirection=_LIGHT,
                lightAmbientCoeff=_AMBIENT,
                lightDiffuseCoeff=_DIFFUSE,
                lightSpecularCoeff=0.0,
                renderer=pybullet.ER_TINY_RENDERER,
                flags=0,
                physicsClientId=self._world.client,
            )
            part = atlas[:, face * self._size : (face + 1) * self._size]
            solid = (body >= 0).view(np.uint8)
            cv2.copyTo(cv2.cvtColor(pixels, cv2.COLOR_RGBA2BGR), solid, part)
        return atlas

    def _look_up(
        self, azimuth: NDArray[np.float64], elevation: NDArray[np.float64]
    ) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
        face = np.floor(azimuth / (pi / 2) + 0.5)
        within = azimuth - face * (pi / 2)
        u = -np.tan(within)  # left of the axis is positive azimuth
        v = np.tan(elevation) / np.cos(within)
        # no blending across the edge of a face, whose neighbour in the atlas is another view
        column = np.clip((u + 1) / 2 * self._size - 0.5, 0, self._size - 1)
        column += face % _FACES * self._size
        row = (self._top - v) / (self._top - self._bottom) * self._rows - 0.5
        row = np.clip(row, 0, self._rows - 1)
        fixed, fraction = cv2.convertMaps(
            column.astype(np.float32), row.astype(np.float32), cv2.CV_16SC2
        )
        return np.asarray(fixed, dtype=np.int16), np.asarray(fraction, dtype=np.uint16)

    def _grain(self, image: Image) -> Image:
        if self._noise is None:
            return image
        start = int(self._rng.integers(len(self._noise) - image.size))
        grain = self._noise[start : start + image.size].reshape(image.shape)
        return np.asarray(cv2.add(image, grain, dtype=cv2.CV_8U), dtype=np.uint8)


def _mirror_rays(mirror: Mirror) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Azimuth and elevation of every pixel of the mirror image, radians."""
    y, x = np.mgrid[0 : mirror.height, 0 : mirror.width].astype(float)
    x, y = x - mirror.centre_x, y - mirror.centre_y
    share = (np.hypot(x, y) - mirror.inner) / (mirror.outer - mirror.inner)
    elevation = mirror.low + np.clip(share, 0.0, 1.0) * (mirror.high - mirror.low)
    return np.arctan2(-x, -y), elevation


def _inside(mirror: Mirror) -> Image:
    """255 on the pixels of the mirror, 0 beside it and where it shows the camera itself."""
    y, x = np.mgrid[0 : mirror.height, 0 : mirror.width].astype(float)
    radius = np.hypot(x - mirror.centre_x, y - mirror.centre_y)
    inside = (radius >= mirror.inner - 0.5) & (radius <= mirror.outer + 0.5)
    return np.repeat(inside[:, :, None], 3, axis=2).astype(np.uint8) * 255


@cache
def _noise_pool(noise: float) -> NDArray[np.int8]:
    """Noise to cut from, the same for all cameras: their own randomness says where to cut."""
    levels = np.random.default_rng(0).standard_normal(_NOISE_POOL) * noise
    return np.clip(np.rint(levels), -127, 127).astype(np.int8)


def _panorama_rays(
    mirror: Mirror, columns: int = 240, rows: int = 48
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    column = pi - (np.arange(columns) + 0.5) * 2 * pi / columns
    row = mirror.high - (np.arange(rows) + 0.5) * (mirror.high - mirror.low) / rows
    azimuth, elevation = np.meshgrid(column, row)
    return azimuth, elevation
