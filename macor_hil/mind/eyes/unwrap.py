"""Unwrapping: the mirror image becomes a panorama, straight ahead in its middle."""

from dataclasses import dataclass
from math import pi
from typing import Annotated

import cv2
import numpy as np
from khepera_protocol.mirror import Mirror
from pydantic import Field

from macor_hil.arrays import Image
from macor_hil.errors import CameraError


@dataclass(frozen=True, slots=True)
class PanoramaSize:
    """Pixels of the panorama; its width covers the full turn, left of the robot at the left."""

    columns: Annotated[int, Field(ge=1, le=2048)] = 120
    rows: Annotated[int, Field(ge=1, le=2048)] = 32


class Unwrapper:
    """Turns mirror images of one geometry into panoramas.

    Attributes:
        mirror: that geometry.
    """

    def __init__(self, mirror: Mirror, size: PanoramaSize) -> None:
        self.mirror = mirror
        self._shape = (mirror.height, mirror.width)
        # azimuth counts counter-clockwise from straight ahead, which is up in the mirror image
        azimuth = pi - (np.arange(size.columns) + 0.5) * 2 * pi / size.columns
        radius = mirror.outer - (np.arange(size.rows) + 0.5) * (
            (mirror.outer - mirror.inner) / size.rows
        )
        x = mirror.centre_x - radius[:, None] * np.sin(azimuth)
        y = mirror.centre_y - radius[:, None] * np.cos(azimuth)
        self._maps = cv2.convertMaps(x.astype(np.float32), y.astype(np.float32), cv2.CV_16SC2)

    def __call__(self, image: Image) -> Image:
        """Return the panorama of a mirror image, top row at the highest elevation.

        Raises:
            CameraError: the picture has another size than the mirror's geometry says.
        """
        if image.shape != (*self._shape, 3):
            height, width = self._shape
            raise CameraError(
                f"the camera gives a picture of shape {image.shape}, the mirror is described for"
                f" {width} x {height} pixels in colour; check the camera"
                " string; pictures of a camera that looks ahead are for --eyes front"
            )
        return np.asarray(cv2.remap(image, *self._maps, cv2.INTER_LINEAR), dtype=np.uint8)
