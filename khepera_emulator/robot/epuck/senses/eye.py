"""The camera at the front of an e-puck: a window of its 640 x 480 pixels, thinned by the zoom."""

from math import atan, cos, sin, tan

import cv2
import numpy as np
from khepera_protocol.zenoh.payloads import Pose
from numpy.typing import NDArray

from khepera_emulator.body.chassis import Chassis
from khepera_emulator.robot.epuck.models import EpuckModel
from khepera_emulator.robot.epuck.panel import COLOUR, GREY, Picture
from khepera_emulator.senses.camera import NOISE
from khepera_emulator.senses.renderers.layered import LayeredRenderer
from khepera_emulator.senses.renderers.view import Image
from khepera_emulator.world.world import World

_COLUMNS, _ROWS = 640, 480
"""Pixels of the camera."""

_LENS = 0.032
"""Metres from the robot's middle to the lens (a choice)."""

_Maps = tuple[NDArray[np.float32], NDArray[np.float32]]


class Eye:
    """The camera of one robot.

    Args:
        world: what is seen.
        model: which robot.
        carrier: its body, which it does not see; others see it.
        rng: source of the noise.
    """

    def __init__(
        self, world: World, model: EpuckModel, carrier: Chassis, rng: np.random.Generator
    ) -> None:
        self._rng = rng
        # pixels that the distance from the pinhole to the picture takes
        self._focal = _COLUMNS / 2 / tan(model.field / 2)
        high = atan(_ROWS / 2 / self._focal)
        self._renderer = LayeredRenderer(world, model.eye_height, -high, high, carrier)
        self._picture = Picture()
        self._maps = self._places(self._picture)

    def take(self, picture: Picture, pose: Pose) -> bytes:
        """Take a picture as the robot sends it, from a place."""
        image = self._look(picture, pose)
        if picture.mode == GREY:
            return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).tobytes()
        if picture.mode == COLOUR:
            # red in the high bits of the first byte, which are the low ones in OpenCV's order
            return cv2.cvtColor(image, cv2.COLOR_BGR2BGR565)[..., ::-1].tobytes()
        return _yuyv(image)

    def _look(self, picture: Picture, pose: Pose) -> Image:
        ahead = {
            "x": pose.x + _LENS * cos(pose.heading),
            "y": pose.y + _LENS * sin(pose.heading),
        }
        atlas = self._renderer.render(pose.model_copy(update=ahead))
        if picture != self._picture:
            self._picture, self._maps = picture, self._places(picture)
        column, row = self._maps
        image = cv2.remap(atlas, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        grain = self._rng.standard_normal(image.shape) * NOISE
        return np.asarray(np.clip(image + np.rint(grain), 0, 255), dtype=np.uint8)

    def _places(self, picture: Picture) -> _Maps:
        """Find the picture's pixels in the renderer's atlas."""
        width, height, zoom = picture.width, picture.height, picture.zoom
        left = (_COLUMNS - width * zoom) / 2 if picture.left < 0 else picture.left
        top = (_ROWS - height * zoom) / 2 if picture.top < 0 else picture.top
        right = left + (np.arange(width) + 0.5) * zoom - _COLUMNS / 2
        down = top + (np.arange(height) + 0.5) * zoom - _ROWS / 2
        across, along = np.meshgrid(right / self._focal, down / self._focal)
        azimuth = np.arctan(-across)
        elevation = np.arctan(-along * np.cos(azimuth))
        column, row = self._renderer.place(azimuth, elevation)
        return column.astype(np.float32), row.astype(np.float32)


def _yuyv(image: Image) -> bytes:
    """Return a picture with a byte of light a pixel, and one of colour for every second."""
    y, u, v = np.moveaxis(cv2.cvtColor(image, cv2.COLOR_BGR2YUV), 2, 0)
    colour = np.where(np.arange(image.shape[1]) % 2 == 0, u, v)
    return np.stack([y, colour], axis=2).tobytes()
