"""A video device or network stream: always its newest picture, also when it comes and goes.

A driver queues pictures, and one that was unplugged makes the next read wait for seconds. So a
thread of its own reads all the time and keeps the newest picture only.
"""

import threading
import time
from collections.abc import Callable
from typing import Any, Final, Protocol

import cv2

from macor_hil.cameras.camera import PATIENCE, Frame, as_image
from macor_hil.errors import CameraError, CameraLostError

_RETRY: Final = 0.5
"""Seconds between two attempts at opening a device that has gone."""


class Capture(Protocol):
    """What is used of OpenCV's VideoCapture."""

    def isOpened(self) -> bool:  # noqa: N802 - OpenCV's name
        """Whether pictures may come."""
        ...

    def read(self) -> tuple[bool, Any]:
        """Whether a picture came, and the picture."""
        ...

    def release(self) -> None:
        """Give the device back."""
        ...


def is_device(name: str) -> bool:
    """Whether a name after `video:` means a source that shows the present."""
    return name.isdecimal() or name.startswith("/dev/") or "://" in name


def open_capture(name: str) -> Capture:
    """OpenCV's capture of a device number, device or address."""
    return cv2.VideoCapture(int(name) if name.isdecimal() else name)


class LiveVideoCamera:
    """The newest picture of a video device.

    Args:
        name: number, device, or address of a stream.
        open_device: makes the capture.

    Raises:
        CameraError: there is no such source, or OpenCV cannot open it.
    """

    live = True

    def __init__(self, name: str, open_device: Callable[[str], Capture] = open_capture) -> None:
        self._name = name
        self._open = open_device
        self._capture = open_device(name)
        if not self._capture.isOpened():
            raise CameraError(f"cannot open the video source {name!r}")
        self._came = threading.Condition()
        self._begun = 0
        self._newest: Frame | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"video {name}", daemon=True)
        self._thread.start()

    def grab(self) -> Frame:
        """The first picture whose reading has not begun before now."""
        with self._came:
            wanted = self._begun + 1
            if self._came.wait_for(lambda: self._number() >= wanted, PATIENCE):
                assert self._newest is not None
                return self._newest
        raise CameraLostError(
            f"no picture from the video source {self._name!r} for {PATIENCE:.0f} s; is its cable"
            " in?"
        )

    def close(self) -> None:
        """Release the device."""
        self._closing.set()
        self._thread.join(PATIENCE)

    def _number(self) -> int:
        return -1 if self._newest is None else self._newest.sequence

    def _run(self) -> None:
        while not self._closing.is_set():
            with self._came:
                self._begun += 1
                number = self._begun
            good, image = self._capture.read()
            if good:
                with self._came:
                    self._newest = Frame(as_image(image), time.time(), number)
                    self._came.notify_all()
            else:
                self._capture.release()
                self._closing.wait(_RETRY)
                self._capture = self._open(self._name)
        self._capture.release()
