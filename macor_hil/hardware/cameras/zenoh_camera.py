"""A camera on a Zenoh key."""

import time
from typing import Final

import zenoh
from khepera_protocol.text import printable
from khepera_protocol.zenoh.keys import CAMERA, EMULATOR_ALIVE
from khepera_protocol.zenoh.payload_model import PayloadError
from khepera_protocol.zenoh.sample_checks import stamp_of

from macor_hil.arrays import Image
from macor_hil.errors import CameraError, CameraLostError, WrongPictureError, WrongRobotError
from macor_hil.hardware.cameras.camera import PATIENCE, Frame
from macor_hil.hardware.cameras.decoding import MAX_BYTES, decode_picture
from macor_hil.hardware.cameras.one_source import OneSource, Round

_LISTEN: Final = 0.25
"""Seconds to listen to a source that does not answer, before it is asked again."""

_PAUSE: Final = 0.05
"""Seconds before a source that has gone is asked again."""

_LONGEST_REASON: Final = 200
_NAMES: Final = 12
"""Names of other robots that an error tells at most."""

_TIMEOUT: Final = b"Timeout"
"""Error of Zenoh for a source that has not answered in time."""


def open_zenoh_camera(session: zenoh.Session, robot: str, source: str = "") -> "ZenohCamera":
    """Open the camera on a Zenoh key, or without one the emulator's camera of a robot."""
    return ZenohCamera(session, source or CAMERA.of(robot), robot if not source else "")


class ZenohCamera:
    """A camera that answers queries on a Zenoh key, or publishes its pictures there.

    A picture is a PNG or JPEG; its time and number come as an attachment (`Stamp`), and are made
    here where a source sends none. The source is chosen with the first picture, see `one_source`:
    one that answers by the Zenoh id of who replies, one that publishes by that of its samples.
    """

    live = True

    def __init__(self, session: zenoh.Session, key: str, robot: str = "") -> None:
        _check_key(key)
        self._robot = robot
        self._session = session
        self._key = key
        self._sequence = 0
        self._source: OneSource[zenoh.Sample] = OneSource(f"the Zenoh key {key}")
        self._answers: bool | None = None
        self._heard: Round[zenoh.Sample] = Round()
        self._subscriber: zenoh.Subscriber[None] | None = None

    def grab(self) -> Frame:
        """Take a picture of the moment at which the camera is asked, or the next one published."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() <= end:
            try:
                sample = self._next()
            except zenoh.ZError as error:
                raise CameraLostError(
                    f"no picture can be asked for on the Zenoh key {self._key}: {error}"
                ) from None
            if sample is not None:
                return self._frame(sample)
        missing = f"no camera answers on the Zenoh key {self._key}"
        if others := self._others():
            there = ", ".join(others[:_NAMES])
            raise WrongRobotError(f"{missing}; there are the robots {there}")
        raise CameraLostError(
            f"{missing}; is the emulator running, with this robot name, and does --connect lead to"
            " it?"
        )

    def close(self) -> None:
        """Stop listening; the session's owner closes it."""
        if self._subscriber is not None:
            self._subscriber.undeclare()
            self._subscriber = None

    def _others(self) -> list[str]:
        """Return names of the robots that are there, where this one never was and is not."""
        if not self._robot or self._answers is not None:
            return []
        try:
            replies = list(self._session.liveliness().get(EMULATOR_ALIVE.of("*"), timeout=_LISTEN))
        except zenoh.ZError:
            return []
        robots = sorted(str(reply.ok.key_expr).split("/")[1] for reply in replies if reply.ok)
        return [] if self._robot in robots else robots

    def _next(self) -> zenoh.Sample | None:
        """Take the source's next picture; None if none comes soon."""
        if self._answers is not False and (sample := self._ask()):
            self._answers = True
            self.close()  # it need not publish for us
            return sample
        if self._answers:
            time.sleep(_PAUSE)
            return None
        sample = self._hear()
        if sample is not None:
            self._answers = False
        return sample

    def _ask(self) -> zenoh.Sample | None:
        """Ask the source for a picture."""
        answers: Round[zenoh.Sample] = Round()

        def take(reply: zenoh.Reply) -> None:
            source = "" if reply.replier_id is None else str(reply.replier_id.zid)
            if reply.ok is not None:
                answers.add(source, reply.ok)
            elif reply.err is not None:
                why = reply.err.payload.to_bytes()[:_LONGEST_REASON]
                if why != _TIMEOUT:
                    answers.refuse(source, printable(why.decode(errors="replace")))

        self._session.get(
            self._key,
            # in the library's own thread: it only puts down what has come
            zenoh.handlers.Callback(take, answers.close, indirect=False),
            timeout=PATIENCE,
            # otherwise one that calls itself complete, or has a later clock, hides the others
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
        )
        return self._source.pick(answers, PATIENCE)

    def _hear(self) -> zenoh.Sample | None:
        """Wait for the next picture that is published, by a source that answers no queries."""
        self._heard = Round()
        if self._subscriber is None:
            self._subscriber = self._session.declare_subscriber(self._key, self._take)
        return self._source.pick(self._heard, _LISTEN)

    def _take(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            self._heard.add(_publisher(sample), sample)

    def _frame(self, sample: zenoh.Sample) -> Frame:
        image = self._decoded(sample)
        try:
            stamp = stamp_of(sample)
        except PayloadError:
            data = b"" if sample.attachment is None else sample.attachment.to_bytes()
            raise WrongPictureError(
                f"the attachment of a picture from {self._key} is no time stamp:"
                f" {printable(data, 80)}"
            ) from None
        if stamp is None:
            self._sequence += 1
            return Frame(image, time.time(), self._sequence)
        return Frame(image, stamp.time, stamp.sequence)

    def _decoded(self, sample: zenoh.Sample) -> Image:
        complaint = f"what came from {self._key} is no picture"
        size = len(sample.payload)
        if size > MAX_BYTES:  # not to be copied
            raise WrongPictureError(
                f"{complaint} ({size:,} bytes): {MAX_BYTES:,} bytes at most are read"
            )
        return decode_picture(sample.payload.to_bytes(), complaint)


def _publisher(sample: zenoh.Sample) -> str:
    """Zenoh id of who has published a sample; empty where it does not tell."""
    if sample.source_info is not None:
        return str(sample.source_info.source_id.zid)
    return "" if sample.timestamp is None else str(sample.timestamp.get_id())


def _check_key(key: str) -> None:
    """Refuse a key that no camera has.

    Raises:
        CameraError: it is malformed, or has wildcards.
    """
    try:
        zenoh.KeyExpr(key)
    except zenoh.ZError:
        bad = True
    else:
        bad = "*" in key
    if bad:
        raise CameraError(f"a camera cannot be on {key!r}; a Zenoh key is such as robot/camera")
