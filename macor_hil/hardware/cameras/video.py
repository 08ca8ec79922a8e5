"""OpenCV's video sources: opened and read within limits of time and size."""

from collections.abc import Callable
from typing import Any, Final, Protocol

import cv2

from macor_hil.arrays import Image
from macor_hil.errors import CameraLostError, WrongPictureError
from macor_hil.hardware.cameras.decoding import MAX_SIDE, as_image

_OPENING: Final = 5.0
"""Seconds that a network stream may take to be opened; OpenCV itself waits 30."""

_SILENCE: Final = 2.0
"""Seconds without a picture after which a network stream is given up; OpenCV itself waits 30."""


class Capture(Protocol):
    """Methods that are used of OpenCV's VideoCapture."""

    def isOpened(self) -> bool:  # noqa: N802 - OpenCV's name
        """Return True if pictures may come."""
        ...

    def read(self) -> tuple[bool, Any]:
        """Return whether a picture came, and the picture."""
        ...

    def get(self, prop: int) -> float:
        """Return a property by OpenCV's number."""
        ...

    def release(self) -> None:
        """Give the device back."""
        ...


def open_capture(name: str) -> Capture:
    """Return OpenCV's capture of a device number, a device, an address or a file."""
    if "://" not in name:
        return cv2.VideoCapture(int(name) if name.isdecimal() else name)
    limits = [
        *(cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, round(1000 * _OPENING)),
        *(cv2.CAP_PROP_READ_TIMEOUT_MSEC, round(1000 * _SILENCE)),
    ]
    return cv2.VideoCapture(name, cv2.CAP_ANY, limits)


def open_video(name: str, open_source: Callable[[str], Capture] = open_capture) -> Capture:
    """Open a source that is there.

    Raises:
        CameraLostError: OpenCV cannot open it.
        WrongPictureError: its pictures are too large to be decoded.
    """
    try:
        capture = open_source(name)
        opened = capture.isOpened()
    except cv2.error:  # such as a device number beyond all
        opened = False
    if not opened:
        raise CameraLostError(f"cannot open the video source {name!r}")
    width = capture.get(cv2.CAP_PROP_FRAME_WIDTH)
    height = capture.get(cv2.CAP_PROP_FRAME_HEIGHT)
    if not max(width, height) <= MAX_SIDE:
        capture.release()
        raise WrongPictureError(
            f"the video source {name!r} claims {width:.0f} x {height:.0f} pixels,"
            f" {MAX_SIDE} x {MAX_SIDE} at most are read"
        )
    return capture


def read_video(capture: Capture, name: str) -> Image | None:
    """Read the next picture; None if none comes.

    Raises:
        WrongPictureError: it has other channels than a camera's picture.
    """
    try:
        good, picture = capture.read()
    except cv2.error:
        return None
    return as_image(picture, f"the video source {name!r} gives no picture") if good else None
