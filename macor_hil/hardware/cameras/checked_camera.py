"""Pictures that must not be acted upon, noticed and named: late, frozen, dark, flat, too small."""

import threading
import time
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from khepera_protocol.mirror import Mirror
from numpy.typing import NDArray

from macor_hil.arrays import Image
from macor_hil.errors import (
    CameraDarkError,
    CameraFlatError,
    CameraFrozenError,
    CameraLateError,
    CameraLostError,
    WrongPictureError,
)
from macor_hil.hardware.cameras.camera import Camera, Frame
from macor_hil.mind.eyes.eyes import Eyes

_STEP: Final = 4
"""Every fourth pixel tells whether a picture is dark."""

_HUNDREDTH: Final = 100
"""Share of the pixels that stands for the darkest or the brightest part of a picture."""

_BRIGHTEST: Final = 99.0
"""Percentile of grey at its lower end."""


@dataclass(frozen=True, slots=True)
class PictureLimits:
    """Limits that a picture must keep.

    Attributes:
        size: width and height in pixels; None: any.
        mirror: where the mirror lies in it; None: it may be all of it.
        dark: grey level, 0 to 255, that the brightest hundredth of the pixels must reach.
        flat: grey levels between the darkest and the brightest hundredth of a channel, in the
            mirror, that some channel must have: noise alone makes 4 to 8.
        late: seconds that a picture may take to come.
        repeats: times that the same picture may come again, bit for bit: a sensor's noise makes
            any two pictures differ.
    """

    size: tuple[int, int] | None = None
    mirror: Mirror | None = None
    dark: float = 24.0
    flat: float = 12.0
    late: float = 0.5
    repeats: int = 0


AHEAD: Final = PictureLimits(flat=0.0)
"""Limits of a camera without a mirror: a wall near it may fill all of its picture."""


def limits_for(mirror: Mirror) -> PictureLimits:
    """Return limits for the camera that a mirror was described for."""
    return PictureLimits(size=(mirror.width, mirror.height), mirror=mirror)


def limits_of(eyes: Eyes) -> PictureLimits:
    """Return limits for a camera that eyes look through."""
    if eyes.mirror is None:
        return replace(AHEAD, size=eyes.picture_size)
    return PictureLimits(size=eyes.picture_size, mirror=eyes.mirror)


class CheckedCamera:
    """A camera all of whose pictures can be acted upon; for several threads.

    Args:
        camera: whose pictures are looked at; late and frozen ones are told of a live one only.
        limits: what they must be like.

    Attributes:
        worked: whether it has ever given a picture that can be acted upon.
    """

    def __init__(self, camera: Camera, limits: PictureLimits) -> None:
        self.live = camera.live
        self.worked = False
        self._camera = camera
        self._limits = limits
        self._lock = threading.Lock()
        self._last: Frame | None = None
        self._same = 0

    def grab(self) -> Frame:
        """Take a picture of this moment.

        Raises:
            CameraError: none came, or one that tells nothing of this moment.
        """
        with self._lock:
            begin = time.monotonic()
            frame = self._camera.grab()
            seconds = time.monotonic() - begin
            check_size(frame.image, self._limits)
            check_light(frame.image, self._limits)
            if self.live:
                self._check_time(frame, seconds)
            self.worked = True
            return frame

    def close(self) -> None:
        """Give the device back."""
        self._camera.close()

    def _check_time(self, frame: Frame, seconds: float) -> None:
        last, self._last = self._last, frame
        again = last is not None and np.array_equal(last.image, frame.image)
        self._same = self._same + 1 if again else 0
        if self._same > self._limits.repeats:
            raise CameraFrozenError(
                f"the camera is frozen: picture {frame.sequence} is the same as the one before,"
                " bit for bit"
            )
        if seconds > self._limits.late:
            raise CameraLateError(
                f"picture {frame.sequence} took {seconds:.2f} s to come, {self._limits.late:g} s at"
                " most are allowed"
            )


def is_hopeless(error: Exception, camera: CheckedCamera) -> bool:
    """Return whether it is of no use to wait: a camera that never worked."""
    return isinstance(error, CameraLostError | WrongPictureError) and not camera.worked


def check_size(image: Image, limits: PictureLimits) -> None:
    """Refuse a picture of another size or format.

    Raises:
        WrongPictureError: it is not a colour picture of that size.
    """
    if limits.size is None:
        return
    width, height = limits.size
    if image.shape != (height, width, 3):
        raise WrongPictureError(
            f"the camera gives a picture of shape {image.shape}, the mirror is described for"
            f" {width} x {height} pixels in colour; check the camera string, or calibrate with:"
            " macor-hil camera --calibrate; a camera that looks ahead is for --eyes front"
        )


def check_light(image: Image, limits: PictureLimits) -> None:
    """Refuse a picture in which nothing can be seen.

    Raises:
        CameraDarkError: even its brightest part is dark.
        CameraFlatError: all of it is alike.
    """
    few = image[::_STEP, ::_STEP]
    brightest = float(np.percentile(few.max(axis=-1), _BRIGHTEST))
    if brightest < limits.dark:
        raise CameraDarkError(
            f"the picture is dark: its brightest part has grey level {brightest:.0f} of 255,"
            f" {limits.dark:.0f} are needed; is the lens covered, or the light off?"
        )
    seen = few.reshape(-1, 3)
    if limits.mirror is not None:
        seen = image.reshape(-1, 3).take(_in_the_mirror(limits.mirror), axis=0)
    k = len(seen) // _HUNDREDTH
    last = len(seen) - 1 - k
    if last < k:
        return  # a mirror of a few pixels
    low, high = np.partition(seen, (k, last), axis=0)[[k, last]]
    if (high - low).max() < limits.flat:
        raise CameraFlatError(
            f"nothing can be seen in the picture: all of it has colours of about"
            f" {', '.join(f'{level:.0f}' for level in high[::-1])} (red, green, blue of 255); is"
            " there too much light, or something before the lens?"
        )


@lru_cache(maxsize=8)
def _in_the_mirror(mirror: Mirror) -> NDArray[np.intp]:
    """Return indices of the pixels to look at: those of the mirror, without its blurred rims."""
    rim = (mirror.outer - mirror.inner) / 16
    y, x = np.mgrid[0 : mirror.height : _STEP, 0 : mirror.width : _STEP]
    radius = np.hypot(x - mirror.centre_x, y - mirror.centre_y)
    inside = (mirror.inner + rim < radius) & (radius < mirror.outer - rim)
    return np.asarray((y * mirror.width + x)[inside])
