"""A camera on a Zenoh key."""

import queue
import time
from typing import Final

import cv2
import numpy as np
import zenoh
from pydantic import ValidationError

from macor_hil.cameras.camera import PATIENCE, Frame, as_image
from macor_hil.errors import CameraError, CameraLostError, WrongPictureError
from protocol.side_channel import Stamp

_LISTEN: Final = 0.25
"""Seconds to listen to a source that does not answer, before it is asked again."""


class ZenohCamera:
    """A camera that answers queries on a Zenoh key, or publishes its pictures there.

    A picture is a PNG or JPEG; its time and number come as an attachment (`Stamp`), and are made
    here where a source sends none.
    """

    live = True

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self._session = session
        self._key = key
        self._sequence = 0
        self._stream: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
        self._subscriber: zenoh.Subscriber[None] | None = None

    def grab(self) -> Frame:
        """A picture of the moment at which the query reaches the camera, or the next published."""
        end = time.monotonic() + PATIENCE
        while True:
            sample = self._ask() or self._hear()
            if sample is not None:
                return self._decode(sample)
            if time.monotonic() > end:
                raise CameraLostError(
                    f"no camera answers on the Zenoh key {self._key}; is the emulator running,"
                    " with this robot name, and does --connect lead to it?"
                )

    def close(self) -> None:
        """Stop listening; the session's owner closes it."""
        if self._subscriber is not None:
            self._subscriber.undeclare()
            self._subscriber = None

    def _ask(self) -> zenoh.Sample | None:
        for reply in self._session.get(self._key, timeout=PATIENCE):
            if reply.ok is None:
                message = reply.err.payload.to_string() if reply.err else "no reason given"
                raise CameraError(f"the camera {self._key} answers: {message}")
            self.close()  # it need not publish for us
            return reply.ok
        return None

    def _hear(self) -> zenoh.Sample | None:
        """The next picture that is published, by a source that answers no queries."""
        if self._subscriber is None:
            self._subscriber = self._session.declare_subscriber(self._key, self._stream.put)
        while not self._stream.empty():
            self._stream.get()
        try:
            return self._stream.get(timeout=_LISTEN)
        except queue.Empty:
            return None

    def _decode(self, sample: zenoh.Sample) -> Frame:
        data = np.frombuffer(sample.payload.to_bytes(), np.uint8)
        image = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
        if image is None:
            raise WrongPictureError(
                f"what came from {self._key} is no picture ({sample.encoding}, {data.size} bytes)"
            )
        attachment = sample.attachment
        if attachment is None:
            self._sequence += 1
            return Frame(as_image(image), time.time(), self._sequence)
        try:
            stamp = Stamp.model_validate_json(attachment.to_bytes())
        except ValidationError:
            raise WrongPictureError(
                f"the attachment of a picture from {self._key} is no time stamp:"
                f" {attachment.to_bytes()[:80]!r}"
            ) from None
        return Frame(as_image(image), stamp.time, stamp.sequence)
