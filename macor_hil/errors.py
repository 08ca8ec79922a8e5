"""Errors of the controller.

MacorError
 +-- RobotError     the serial line or the robot on it
 +-- CameraError    no picture, or one that cannot be used
 +-- MapError       a map file that is missing, damaged, or of another version
 +-- BenchError     the emulator's side channel: reset and ground truth
 +-- TelemetryError the Zenoh session: its endpoints, names and payloads
"""


class MacorError(Exception):
    """The controller cannot go on; the message says what, with what, and what to try."""


class RobotError(MacorError):
    """The robot does not answer, or not as a Khepera."""


class CameraError(MacorError):
    """The camera gives no usable picture."""


class MapError(MacorError):
    """The map file cannot be used."""


class BenchError(MacorError):
    """The emulator refuses a reset, or cannot be reached over its side channel."""


class TelemetryError(MacorError):
    """The Zenoh session cannot be opened, or what came over it cannot be read."""
