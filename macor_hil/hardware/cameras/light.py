"""Other light than in training: pictures with another brightness, white balance or contrast."""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from macor_hil.arrays import Image
from macor_hil.hardware.cameras.camera import Camera, Frame


@dataclass(frozen=True, slots=True)
class Light:
    """Effects of light and camera on a picture; without any of it pictures stay as they are.

    Attributes:
        blue, green, red: what each channel is multiplied with.
        haze: grey level, 0 to 255, that is added to all channels.
    """

    blue: float = 1.0
    green: float = 1.0
    red: float = 1.0
    haze: float = 0.0

    def on(self, picture: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a picture in this light, not yet limited to what a camera can show."""
        lit: NDArray[np.float64] = picture * (self.blue, self.green, self.red) + self.haze
        return lit


def brightness(share: float) -> Light:
    """Return a light that is a share as bright."""
    return Light(share, share, share)


def fog(share: float) -> Light:
    """Return a light whose black is as bright as if fog took all but a share of the contrast."""
    return Light(haze=255 * (1 - share) / 2)


LIGHTS: Final = MappingProxyType(
    {
        "as trained": Light(),
        "dim": brightness(0.8),
        "bright": brightness(1.2),
        "warm": Light(blue=0.8, red=1.1),
        "cold": Light(blue=1.1, red=0.8),
        "foggy": fog(0.8),
    }
)
"""Lights that experiments name."""


class LitCamera:
    """A camera in another light.

    Args:
        camera: whose pictures are changed.
        light: in which everything stands.
    """

    def __init__(self, camera: Camera, light: Light) -> None:
        self.live = camera.live
        self._camera = camera
        self._light = light

    def grab(self) -> Frame:
        """Take a picture of this moment.

        Raises:
            CameraError: none came, or none that can be read.
        """
        frame = self._camera.grab()
        lit = np.clip(np.rint(self._light.on(frame.image.astype(np.float64))), 0, 255)
        image: Image = lit.astype(np.uint8)
        return Frame(image, frame.time, frame.sequence)

    def close(self) -> None:
        """Give the device back."""
        self._camera.close()
