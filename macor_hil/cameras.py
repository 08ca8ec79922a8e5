"""Cameras by one string: `port`, `zenoh[:KEY]`, `video:DEVICE` or `video:FILE`.

* `port`: the camera of the robot behind a `khepera://` port.
* `zenoh:khepera/khepera/camera`: a query on a Zenoh key, answered with a PNG or JPEG.
* `video:0`, `video:/dev/video0`, `video:drive.mp4`: whatever OpenCV can open.
"""

from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
import zenoh
from pydantic import ValidationError

from macor_hil.errors import CameraError
from macor_hil.vision.unwrap import Image
from protocol.side_channel import Stamp

PATIENCE = 2.0
"""Seconds that a picture may take."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A picture, when it was taken on the camera's clock (seconds), and its number."""

    image: Image
    time: float
    sequence: int


class Camera(Protocol):
    """A source of mirror images."""

    def grab(self) -> Frame:
        """A picture of this moment.

        Raises:
            CameraError: none came, or none that can be read.
        """
        ...

    def close(self) -> None:
        """Give the device back."""
        ...


class PortCamera:
    """The camera of an emulated robot in this process."""

    def __init__(self, port: Any) -> None:
        if not hasattr(port, "emulator"):
            raise CameraError(
                "the camera 'port' belongs to khepera:// ports; for another port name a camera:"
                " zenoh:KEY or video:DEVICE"
            )
        self._port = port
        self._sequence = -1

    def grab(self) -> Frame:
        """A picture of this moment of virtual time."""
        self._sequence += 1
        return Frame(self._port.emulator.mirror_image(), self._port.now, self._sequence)

    def close(self) -> None:
        """The port owns the camera."""


class ZenohCamera:
    """A camera that answers queries on a Zenoh key."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self._session = session
        self._key = key

    def grab(self) -> Frame:
        """A picture of the moment at which the query reaches the camera."""
        for reply in self._session.get(self._key, timeout=PATIENCE):
            if reply.ok is None:
                message = reply.err.payload.to_string() if reply.err else "no reason given"
                raise CameraError(f"the camera {self._key} answers: {message}")
            return self._decode(reply.ok)
        raise CameraError(
            f"no camera answers on the Zenoh key {self._key}; is the emulator running, with this"
            " robot name, and does --connect lead to it?"
        )

    def close(self) -> None:
        """The session's owner closes it."""

    def _decode(self, sample: zenoh.Sample) -> Frame:
        data = np.frombuffer(sample.payload.to_bytes(), np.uint8)
        image = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
        attachment = sample.attachment
        try:
            stamp = Stamp.model_validate_json(attachment.to_bytes() if attachment else b"")
        except ValidationError:
            stamp = None
        if image is None or stamp is None:
            raise CameraError(
                f"what came from {self._key} is no picture with a time stamp"
                f" ({sample.encoding}, {data.size} bytes)"
            )
        return Frame(np.asarray(image, dtype=np.uint8), stamp.time, stamp.sequence)


class VideoCamera:
    """A video device or file."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._capture = cv2.VideoCapture(int(name) if name.isdecimal() else name)
        if not self._capture.isOpened():
            raise CameraError(f"cannot open the video source {name!r}")
        # the newest picture, not one from a queue
        self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        self._sequence = -1

    def grab(self) -> Frame:
        """The next picture of the device or file."""
        good, image = self._capture.read()
        if not good:
            raise CameraError(f"no more pictures from the video source {self._name!r}")
        self._sequence += 1
        when = cv2.getTickCount() / cv2.getTickFrequency()
        return Frame(np.asarray(image, dtype=np.uint8), when, self._sequence)

    def close(self) -> None:
        """Release the device."""
        self._capture.release()


def open_camera(name: str, *, port: Any, session: zenoh.Session | None, robot: str) -> Camera:
    """The camera of a string; see the module's text.

    Raises:
        CameraError: no such kind of camera, or it cannot be opened.
    """
    kind, _, rest = name.partition(":")
    if kind == "port" and not rest:
        return PortCamera(port)
    if kind == "video" and rest:
        return VideoCamera(rest)
    if kind == "zenoh":
        if session is None:
            raise CameraError(f"the camera {name!r} needs Zenoh, which is switched off")
        return ZenohCamera(session, rest or f"khepera/{robot}/camera")
    raise CameraError(
        f"unknown camera {name!r}; give port, zenoh[:KEY], video:DEVICE or video:FILE"
    )
