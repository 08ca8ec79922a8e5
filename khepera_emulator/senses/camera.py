"""The omnidirectional camera: a renderer draws what is around, one look-up makes the picture.

The renderer draws an atlas of everything around the robot; a map computed once says from where in
it every pixel of the mirror image (or of the panorama) comes.
"""

from functools import cache
from math import pi

import cv2
import numpy as np
from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.payloads import Pose
from numpy.typing import NDArray

from khepera_emulator.body.chassis import Chassis
from khepera_emulator.senses.renderers.layered import LayeredRenderer
from khepera_emulator.senses.renderers.view import Image, Renderer
from khepera_emulator.world.world import World

HEIGHT = 0.06
"""Metres of the mirror's viewpoint above the floor (a choice)."""

NOISE = 2.0
"""Standard deviation of the camera's noise in grey levels (a choice)."""

_NOISE_POOL = 1 << 20


class OmniCamera:
    """Camera on a robot's back.

    Args:
        world: what is seen.
        rng: source of the camera's noise.
        mirror: geometry of the mirror image.
        noise: standard deviation in grey levels.
        carrier: the robot's body, which its camera does not see; others see it.
        renderer: what draws; none: the emulator's own.

    Attributes:
        rng: source of its noise.
    """

    def __init__(
        self,
        world: World,
        rng: np.random.Generator,
        mirror: Mirror = Mirror(),  # noqa: B008 - an immutable value
        noise: float = NOISE,
        carrier: Chassis | None = None,
        renderer: Renderer | None = None,
    ) -> None:
        self._renderer = renderer or LayeredRenderer(
            world, HEIGHT, mirror.low, mirror.high, carrier
        )
        self._mirror_map = self._look_up(*_mirror_rays(mirror))
        self._panorama_map = self._look_up(*_panorama_rays(mirror))
        self._inside = _inside(mirror)
        self.rng = rng
        self._noise = _noise_pool(noise) if noise > 0.0 else None

    def mirror_image(self, pose: Pose) -> Image:
        """Take a picture of the mirror; black outside of it."""
        image = self._grain(self._remap(pose, self._mirror_map))
        return np.asarray(cv2.bitwise_and(image, self._inside), dtype=np.uint8)

    def panorama(self, pose: Pose) -> Image:
        """Take an unwrapped picture: ahead in the middle, left at the left, up at the top."""
        return self._grain(self._remap(pose, self._panorama_map))

    def _remap(self, pose: Pose, maps: tuple[NDArray[np.int16], NDArray[np.uint16]]) -> Image:
        atlas = self._renderer.render(pose)
        picture = cv2.remap(atlas, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        return np.asarray(picture, dtype=np.uint8)

    def _look_up(
        self, azimuth: NDArray[np.float64], elevation: NDArray[np.float64]
    ) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
        column, row = self._renderer.place(azimuth, elevation)
        fixed, fraction = cv2.convertMaps(
            column.astype(np.float32), row.astype(np.float32), cv2.CV_16SC2
        )
        return np.asarray(fixed, dtype=np.int16), np.asarray(fraction, dtype=np.uint16)

    def _grain(self, image: Image) -> Image:
        if self._noise is None:
            return image
        start = int(self.rng.integers(len(self._noise) - image.size))
        grain = self._noise[start : start + image.size].reshape(image.shape)
        return np.asarray(cv2.add(image, grain, dtype=cv2.CV_8U), dtype=np.uint8)


def _mirror_rays(mirror: Mirror) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return azimuth and elevation of every pixel of the mirror image, radians."""
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
    """Draw noise to cut from, the same for all cameras: their own randomness says where to cut."""
    levels = np.random.default_rng(0).standard_normal(_NOISE_POOL) * noise
    return np.clip(np.rint(levels), -127, 127).astype(np.int8)


def _panorama_rays(
    mirror: Mirror, columns: int = 240, rows: int = 48
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    column = pi - (np.arange(columns) + 0.5) * 2 * pi / columns
    row = mirror.high - (np.arange(rows) + 0.5) * (mirror.high - mirror.low) / rows
    azimuth, elevation = np.meshgrid(column, row)
    return azimuth, elevation
