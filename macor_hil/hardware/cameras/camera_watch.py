"""A camera that fails while the robot drives is noticed while it drives.

The controller looks once a command, when the robot stands. In between a thread takes pictures and
throws them away; the driver asks `guard` between any two requests to the robot.
"""

import time
from queue import SimpleQueue
from typing import Final, NoReturn, Self

from macor_hil.errors import CameraError, CameraLostError
from macor_hil.hardware.cameras.camera import Camera
from macor_hil.safety.helper_thread import HelperThread

DEFAULT_LIMIT: Final = 0.2
"""Seconds of driving without a picture: what is left of half a second is for the stop."""

_PERIOD: Final = 0.06
"""Seconds between two pictures."""

_AWAKE: Final = 0.25
"""Seconds after the last question for which pictures are taken."""


class CameraWatch:
    """Watches a live camera while it is asked for; use as a context.

    Its end waits for nothing: a picture that is on its way must not delay who stops the robot. The
    thread ends when that picture has come, or is not waited for any more.

    Args:
        camera: checked already, and fit for several threads.
        limit: seconds of driving without a usable picture.
    """

    def __init__(self, camera: Camera, limit: float = DEFAULT_LIMIT) -> None:
        self._camera = camera
        self._limit = limit
        self._error: CameraError | None = None
        self._asked = self._begun = self._seen = float("-inf")
        self._wake: SimpleQueue[None] = SimpleQueue()
        self._closing = False
        self._thread: HelperThread | None = None

    def __enter__(self) -> Self:
        if self._camera.live and self._limit > 0.0:
            self._start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing = True
        self._wake.put(None)

    def guard(self) -> None:
        """See that the camera works while the robot drives.

        Raises:
            CameraError: it does not, or nobody watches it any more.
        """
        if self._thread is None:
            return
        now = time.monotonic()
        if now - self._asked > _AWAKE:
            self._begun, self._error = now, None
            if self._thread.ended():
                self._start()
        self._asked = now
        if self._wake.empty():
            self._wake.put(None)
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        silence = now - max(self._begun, self._seen)
        if why := self._thread.ended():
            self._fail(f"the camera is watched no more: {why}")
        if silence > self._limit:
            self._fail(
                f"no picture has come for {silence:.2f} s while the robot drives,"
                f" {self._limit:g} s at most are allowed"
            )

    def _start(self) -> None:
        self._thread = HelperThread(self._run, "camera watch")
        self._thread.start()

    def _fail(self, why: str) -> NoReturn:
        self._asked = float("-inf")  # the next drive begins anew
        raise CameraLostError(why)

    def _run(self) -> None:
        while not self._closing:
            if time.monotonic() - self._asked > _AWAKE:
                self._wake.get()
                continue
            try:
                self._camera.grab()
                self._seen = time.monotonic()
            except CameraError as error:
                self._error = error
            time.sleep(_PERIOD)
