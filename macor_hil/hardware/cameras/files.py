"""Recorded pictures: a video file, or a folder of images."""

from pathlib import Path
from typing import Final

import cv2

from macor_hil.errors import CameraError, CameraLostError
from macor_hil.hardware.cameras.camera import Frame
from macor_hil.hardware.cameras.decoding import read_picture
from macor_hil.hardware.cameras.video import open_video, read_video

_IMAGES: Final = (".bmp", ".jpeg", ".jpg", ".png")


class VideoFileCamera:
    """A video file, one picture after the other; times are those in the video.

    Raises:
        CameraError: there is no such file, or OpenCV cannot read it.
    """

    live = False

    def __init__(self, name: str) -> None:
        self._name = name
        try:
            self._capture = open_video(name)
        except CameraLostError as error:  # a device may come; a file is there, or is named wrongly
            raise CameraError(str(error)) from None
        self._sequence = -1

    def grab(self) -> Frame:
        """Return the next picture of the file."""
        image = read_video(self._capture, self._name)
        if image is None:
            raise CameraLostError(f"no more pictures from the video source {self._name!r}")
        self._sequence += 1
        seconds = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000
        return Frame(image, seconds, self._sequence)

    def close(self) -> None:
        """Close the file."""
        self._capture.release()


class ImagesCamera:
    """The pictures of a folder, in the order of their names; their times are their numbers."""

    live = False

    def __init__(self, source: str) -> None:
        self._folder = Path(source)
        try:
            entries = sorted(self._folder.iterdir())
        except OSError as error:
            raise CameraError(f"cannot read the folder {source}: {error.strerror}") from None
        self._files = [entry for entry in entries if entry.suffix.lower() in _IMAGES]
        if not self._files:
            raise CameraError(f"the folder {source} holds no pictures ({', '.join(_IMAGES)})")
        self._next = 0

    def grab(self) -> Frame:
        """Return the next picture of the folder."""
        if self._next >= len(self._files):
            raise CameraLostError(
                f"no more pictures in {self._folder}: all {len(self._files)} have been shown"
            )
        number = self._next
        self._next += 1
        return Frame(read_picture(self._files[number]), float(number), number)

    def close(self) -> None:
        """Do nothing: no file is kept open."""
