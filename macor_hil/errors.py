"""Errors of the controller.

MacorError
 +-- RobotError             the serial line or the robot on it
 |    +-- LinkError           the port failed: a cable, an adapter, a server
 |    |    +-- WrongPortError      no port can ever be had by that address
 |    +-- SilenceError        no reply in time, or half of one
 |    +-- GarbageError        a reply that does not belong to its request
 |    +-- RobotResetError     the robot has started again and forgotten what it was told
 |    +-- StrayedError        the robot went elsewhere than it was sent
 |    +-- NotStoppedError     no stop was confirmed: the robot may still drive
 +-- CameraError            no picture, or one that cannot be used
 |    +-- CameraLostError     none came
 |    |    +-- WrongRobotError     no robot of that name is there, but others are
 |    +-- CameraLateError     it came too late
 |    +-- CameraFrozenError   the same one again
 |    +-- CameraDarkError     nothing can be seen in it: it is dark
 |    +-- CameraFlatError     nothing can be seen in it: all of it is alike, such as white
 |    +-- WrongPictureError   it has another size or format than it should, or is damaged
 |    +-- CameraSourceError   it comes from another source than before, or from several
 +-- ProfileError           a robot's profile that is missing, damaged, or of another version
 +-- CalibrationError       moves that tell nothing of the wheels, or nothing possible
 +-- MapError               a map file that is missing, damaged, or of another version
 +-- BenchError             the emulator's side channel: reset and ground truth
 +-- TelemetryError         the Zenoh session: its endpoints, names and payloads
 |    +-- TelemetryLostError  nothing can be told any more
 +-- RecordingError         a recording that cannot be written or read
"""

from typing import Final


class MacorError(Exception):
    """The controller cannot go on; the message says what, with what, and what to try."""


class RobotError(MacorError):
    """The robot does not answer, or not as a Khepera.

    Attributes:
        sent: bytes of the request, empty where there was none.
        came: bytes that came back.
    """

    def __init__(self, message: str, sent: bytes = b"", came: bytes = b"") -> None:
        super().__init__(message)
        self.sent = sent
        self.came = came


class LinkError(RobotError):
    """The serial port cannot be opened, or has failed."""


class WrongPortError(LinkError):
    """No port can ever be had by that address: to wait for it is of no use."""


class SilenceError(RobotError):
    """No whole reply came in time."""


class GarbageError(RobotError):
    """A reply to something else than what was asked."""


class RobotResetError(RobotError):
    """The robot has started again: it stands, and its settings are those of power-on."""


class StrayedError(RobotError):
    """The counters are not where the last command leads: it did not arrive as it was sent."""


class NotStoppedError(RobotError):
    """No stop was confirmed: the robot may still drive to the end of its last command."""


class CameraError(MacorError):
    """The camera gives no usable picture."""


class CameraLostError(CameraError):
    """No picture came."""


class WrongRobotError(CameraLostError):
    """No robot of that name is there, but others are."""


class CameraLateError(CameraError):
    """A picture came too late to say anything of now."""


class CameraFrozenError(CameraError):
    """The camera shows the same picture again and again."""


class CameraDarkError(CameraError):
    """Nothing can be seen in the picture: it is dark."""


class CameraFlatError(CameraError):
    """Nothing can be seen in the picture: all of it is alike, such as white or grey."""


class WrongPictureError(CameraError):
    """The picture is damaged, or of another size or format than it should be."""


class CameraSourceError(CameraError):
    """Pictures come from another source than before, or from several."""


class ProfileError(MacorError):
    """The robot's profile cannot be used."""


class CalibrationError(MacorError):
    """Marked moves tell nothing of the wheels, or something that no robot can be."""


class MapError(MacorError):
    """The map file cannot be used."""


class BenchError(MacorError):
    """The emulator refuses a reset, or cannot be reached over its side channel."""


class TelemetryError(MacorError):
    """The Zenoh session cannot be opened, or what came over it cannot be read."""


class TelemetryLostError(TelemetryError):
    """Nothing can be told of a run any more."""


class RecordingError(MacorError):
    """A recording cannot be written or read."""


_NEVER: Final = (WrongPortError, WrongRobotError)
"""Kinds of what is lost that are of no use to wait for."""

_LOST: Final = (
    *(RobotError, BenchError, TelemetryLostError),
    *(CameraLostError, CameraLateError, CameraFrozenError, CameraDarkError, CameraFlatError),
    CameraSourceError,
)


def is_lost(error: Exception) -> bool:
    """Return True if a device failed or is not there: it may come, or come back.

    Everything else is refused: options, files or devices that do not fit each other, and will not
    however often it is tried.
    """
    return isinstance(error, _LOST) and not isinstance(error, _NEVER)
