"""Client of an e-puck on any pySerial port, by binary rows and text.

A look is one row: the speeds that the wheels shall have, the speeds that the robot was told (which
says that they have arrived), infrared sensors and step counters.
"""

from collections.abc import Callable
from typing import Any, Final

from khepera_protocol.epuck.codes import PICTURE_HEAD, byte_of, pack, row, unpack
from khepera_protocol.epuck.generations import GCTRONIC2, GENERATIONS, Generation

from macor_hil.arrays import Image
from macor_hil.errors import GarbageError
from macor_hil.hardware.robots.epuck.line import EpuckLine
from macor_hil.hardware.robots.epuck.readings import image_of, volts_of
from macor_hil.hardware.robots.epuck.steering import Pair, Seen, SteeredEpuck

_STOP: Final = row(("D", pack((0, 0))))
_STOP_AND_READ: Final = row(("D", pack((0, 0))), "E")

_SPEEDS, _PROXIMITY, _STEPS = slice(0, 4), slice(4, 20), slice(20, 24)
_SIZE: Final = 24

COLOUR, WIDTH, HEIGHT, _ZOOM = 1, 40, 30, 16
"""All that the camera sees, every 16th pixel; 2403 bytes take 0.21 s at 115200 baud."""

_HEAD: Final = bytes([COLOUR, WIDTH, HEIGHT])


class Epuck(SteeredEpuck[EpuckLine]):
    """An e-puck on an open serial port; see `SteeredEpuck`.

    Args:
        port: an open pySerial port.
        reopen: opens that port again after it has failed; None: it cannot be.
    """

    def __init__(self, port: Any, reopen: Callable[[], Any] | None = None) -> None:
        super().__init__(port, reopen, EpuckLine, _stand, _STOP)
        self._firmware: Generation | None = None
        self._framed = False

    def connect(self) -> tuple[str, ...]:
        """Clear the line, ask for the version, and see where the counters are.

        Raises:
            RobotError: nothing on the port answers like an e-puck.
        """
        self._line.clear()
        line = self._line.say("V")
        if not line.startswith(b"v,"):
            raise GarbageError(f"sent b'V\\r' and got {line!r}: is this an e-puck?", b"V\r", line)
        self._line.clear()  # of the second line, which some firmwares say
        self._line.reset_seen = False
        said = line.decode("ascii", "replace")
        self._firmware = next((each for each in GENERATIONS if each.version[0] == said), None)
        self._begin()
        return (line[2:].decode("ascii", "replace"),)

    def battery(self) -> float | None:
        """Return the battery's voltage; None where the firmware tells none."""
        firmware = self._firmware
        if firmware is None or byte_of("b") not in firmware.codes:
            return None
        answer = self._repeated(lambda: self._metered(lambda: self._line.ask(row("b"), 2)), _STOP)
        return volts_of(*unpack(answer), second=firmware is GCTRONIC2)

    def picture(self) -> Image:
        """Take a picture of the robot's camera: all that it sees, thinned; see `Seeing`."""
        return self._repeated(lambda: self._metered(self._take_picture), _STOP)

    def _take_picture(self) -> Image:
        if not self._framed:
            self._line.say("J", COLOUR, WIDTH, HEIGHT, _ZOOM)
            self._framed = True
        size = WIDTH * HEIGHT * 2
        answer = self._line.ask(row("I"), PICTURE_HEAD + size)
        if answer[:PICTURE_HEAD] != _HEAD:
            self._framed = False  # it has been reset, or somebody else has set another one
            raise GarbageError(f"a picture begins with {answer[:PICTURE_HEAD]!r}", row("I"))
        return image_of(answer[PICTURE_HEAD:], WIDTH, HEIGHT)

    def _ask(self, speeds: Pair) -> Seen:
        answer = self._line.ask(row(("D", pack(speeds)), "E", "N", "Q"), _SIZE)
        if unpack(answer[_SPEEDS], signed=True) != speeds:
            raise GarbageError(f"told {speeds} and read back {answer[_SPEEDS]!r}", b"", answer)
        return Seen(unpack(answer[_PROXIMITY]), unpack(answer[_STEPS], signed=True))

    def _read_steps(self) -> Pair:
        left, right = unpack(self._line.ask(row("Q"), 4), signed=True)
        return left, right


def _stand(line: EpuckLine) -> None:
    line.clear(_STOP_AND_READ)
    if line.ask(_STOP_AND_READ, 4) != bytes(4):
        raise GarbageError("told to stop, and the robot has other speeds", _STOP_AND_READ)
