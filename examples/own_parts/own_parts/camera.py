"""A camera without a device: a wheel of colours that turns from picture to picture."""

import cv2
import numpy as np

from macor_hil.errors import CameraError
from macor_hil.hardware.cameras import Frame

_SIZE = 160
"""Pixels of a side: as the mirror is described by default."""


class PatternCamera:
    """A test pattern.

    Args:
        source: degrees by which the wheel turns from one picture to the next.
    """

    live = False

    def __init__(self, source: str = "10") -> None:
        try:
            self._step = float(source)
        except ValueError:
            raise CameraError(f"a pattern turns by degrees, not by {source!r}") from None
        y, x = np.mgrid[:_SIZE, :_SIZE] - _SIZE / 2
        self._bearings = np.degrees(np.arctan2(y, x))
        self._next = 0

    def grab(self) -> Frame:
        """Draw the next picture."""
        number, self._next = self._next, self._next + 1
        hue = (self._bearings + self._step * number) % 360 / 2  # OpenCV counts half degrees
        full = np.full_like(hue, 255)
        colours = np.stack([hue, full, full], axis=-1).astype(np.uint8)
        image = cv2.cvtColor(colours, cv2.COLOR_HSV2BGR)
        return Frame(image.astype(np.uint8), float(number), number)

    def close(self) -> None:
        """Do nothing: there is no device."""
