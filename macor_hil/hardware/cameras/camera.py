"""The interface of cameras."""

from dataclasses import dataclass
from typing import Final, Protocol

from macor_hil.arrays import Image

PATIENCE: Final = 2.0
"""Seconds that a picture may take."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A picture, when it was taken on the camera's clock (seconds), and its number."""

    image: Image
    time: float
    sequence: int


class Camera(Protocol):
    """A source of mirror images.

    Attributes:
        live: whether it shows the present, so that a picture may come late, or again.
    """

    live: bool

    def grab(self) -> Frame:
        """Take a picture of this moment.

        Raises:
            CameraError: none came, or none that can be read.
        """
        ...

    def close(self) -> None:
        """Give the device back."""
        ...
