"""Cameras that are reached through the robot's port: an emulated one's, and a robot's own."""

from typing import Any

from macor_hil.errors import CameraError, CameraLostError, RobotError
from macor_hil.hardware.cameras.camera import Frame
from macor_hil.hardware.robots.robot import Seeing


class PortCamera:
    """The camera of the robot behind a `khepera://` port."""

    live = False
    """It lives in the port's time, which passes only when the port is used."""

    def __init__(self, port: Any) -> None:
        if not hasattr(port, "emulator"):
            raise CameraError(
                "the camera 'port' belongs to khepera:// ports; for another port name a camera:"
                " zenoh:KEY or video:DEVICE"
            )
        self._port = port
        self._sequence = -1

    def grab(self) -> Frame:
        """Take a picture of this moment of virtual time."""
        self._sequence += 1
        return Frame(self._port.emulator.mirror_image(), self._port.now, self._sequence)

    def close(self) -> None:
        """Do nothing: the port owns the camera."""


class OwnCamera:
    """The camera of a robot that has one.

    Args:
        client: of the robot.
    """

    live = False
    """Its pictures come on the line that the robot is driven by, one after the other: none can be
    looked for while it drives."""

    def __init__(self, client: Any) -> None:
        if not isinstance(client, Seeing):
            raise CameraError(
                "the camera 'own' is a robot's own over its line, and this robot has none there;"
                " give another one"
            )
        self._client = client
        self._sequence = -1

    def grab(self) -> Frame:
        """Take a picture of this moment.

        Raises:
            CameraLostError: the robot did not send one.
        """
        try:
            image = self._client.picture()
        except RobotError as error:
            raise CameraLostError(f"the robot sent no picture: {error}") from error
        self._sequence += 1
        return Frame(image, self._client.clock(), self._sequence)

    def close(self) -> None:
        """Do nothing: the robot owns the camera."""
