"""The camera of an emulated robot in this process."""

from typing import Any

from macor_hil.errors import CameraError
from macor_hil.hardware.cameras.camera import Frame


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
