"""A video device or network stream: always its newest picture, also when it comes and goes.

A driver queues pictures, and one that was unplugged makes the next read wait for seconds. So a
thread of its own reads all the time and keeps the newest picture only. A stream that goes silent
is given up after two seconds (`video`) and opened again; a device of Video4Linux after the ten
seconds of OpenCV's own limit, which nothing here can change.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Final

from macor_hil.errors import CameraError, CameraLostError, WrongPictureError
from macor_hil.hardware.cameras.camera import PATIENCE, Camera, Frame
from macor_hil.hardware.cameras.files import VideoFileCamera
from macor_hil.hardware.cameras.video import Capture, open_capture, open_video, read_video
from macor_hil.safety.helper_thread import END_PATIENCE, HelperThread

_RETRY: Final = 0.5
"""Seconds between two attempts at opening a device that has gone."""

_POLL: Final = 0.002
"""Seconds between two looks for a new picture: no lock that a Ctrl-C could leave locked."""


def open_video_camera(source: str) -> Camera:
    """Open a video device or stream, or a video file.

    Raises:
        CameraError: there is no such source, or OpenCV cannot open it.
    """
    return LiveVideoCamera(source) if is_device(source) else VideoFileCamera(source)


def is_device(name: str) -> bool:
    """Return True for a name of a device or a stream, which shows the present."""
    return name.isdecimal() or name.startswith("/dev/") or "://" in name


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
        self._capture: Capture | None = open_video(name, open_device)
        self._begun = 0
        self._newest: Frame | None = None
        self._wrong = ""
        self._closing: SimpleQueue[None] = SimpleQueue()
        self._thread = HelperThread(self._run, f"video {name}")
        self._thread.start()

    def grab(self) -> Frame:
        """Return the first picture whose reading has not begun before now."""
        wanted = self._begun + 1
        end = time.monotonic() + PATIENCE
        while self._newest is None or self._newest.sequence < wanted:
            if self._wrong:
                raise WrongPictureError(self._wrong)
            if why := self._thread.ended():
                raise CameraLostError(f"the video source {self._name!r} is read no more: {why}")
            if time.monotonic() > end:
                raise CameraLostError(
                    f"no picture from the video source {self._name!r} for {PATIENCE:.0f} s; is its"
                    " cable in?"
                )
            time.sleep(_POLL)
        return self._newest

    def close(self) -> None:
        """Have the device released: at once if it works, soon if it is silent."""
        self._closing.put(None)
        self._thread.join(END_PATIENCE)

    def _run(self) -> None:
        while self._closing.empty():
            if self._capture is None or not self._read(self._capture):
                self._reopen()
        if self._capture is not None:
            self._capture.release()

    def _read(self, capture: Capture) -> bool:
        self._begun = number = self._begun + 1
        try:
            image = read_video(capture, self._name)
        except WrongPictureError as error:
            self._wrong = str(error)
            return False
        if image is None:
            return False
        self._newest, self._wrong = Frame(image, time.time(), number), ""
        return True

    def _reopen(self) -> None:
        if self._capture is not None:
            self._capture.release()
            self._capture = None
        with suppress(Empty):
            self._closing.get(timeout=_RETRY)
            self._closing.put(None)
            return
        try:
            self._capture = open_video(self._name, self._open)
        except WrongPictureError as error:
            self._wrong = str(error)
        except CameraError:
            self._wrong = ""  # it is gone; the next attempt may find it
