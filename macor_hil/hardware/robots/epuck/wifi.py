"""Client of an e-puck2 on WiFi: a packet of all actuators out, one of all sensors in.

TCP lets no byte be lost or bent, so that what was told has arrived once it is answered.
"""

from collections.abc import Callable
from typing import Any, Final

from khepera_protocol.epuck.codes import SENSORS_SIZE
from khepera_protocol.epuck.packets import Actuators, AllSensors
from khepera_protocol.epuck.wifi import HEIGHT, PICTURE, SENSORS, SIZES, WIDTH, WifiRequest

from macor_hil.arrays import Image
from macor_hil.errors import GarbageError, SilenceError
from macor_hil.hardware.line.open_line import BABBLE, PORT_ERRORS, QUIET, OpenLine, port_failed
from macor_hil.hardware.robots.epuck.readings import image_of, volts_of
from macor_hil.hardware.robots.epuck.steering import Pair, Seen, SteeredEpuck

_PATIENCES: Final = {SENSORS: 0.25, PICTURE: 1.0}
"""Seconds that an answer may take."""

_STOP: Final = WifiRequest().pack()
_STANDING: Final = 0.03
"""Seconds after which a robot that was told to stop has another count if it does not."""


class WifiLine(OpenLine):
    """Packets over an open port; see `OpenLine`."""

    def ask(self, speeds: Pair) -> AllSensors:
        """Tell the wheels their speeds, steps a second; returns what the robot senses then.

        Raises:
            SilenceError: no whole packet came in time.
            GarbageError: another one came.
            LinkError: the port failed.
        """
        request = WifiRequest(actuators=Actuators(wheels=speeds))
        return AllSensors.unpack(self._exchange(request, SENSORS)[:SENSORS_SIZE])

    def picture(self) -> bytes:
        """Stand, and return the pixels of a picture.

        Raises:
            SilenceError, GarbageError, LinkError: see `ask`.
        """
        return self._exchange(WifiRequest(pictures=True, sensors=False), PICTURE)

    def _exchange(self, request: WifiRequest, head: int) -> bytes:
        sent, size = request.pack(), 1 + SIZES[head]
        try:
            self.port.write(sent)
            start = self.clock()
            data = bytes(self.port.read(size))
            while len(data) < size and self.clock() - start < _PATIENCES[head]:
                data += self.port.read(size - len(data))
        except PORT_ERRORS as error:
            raise port_failed(sent, error) from None
        if len(data) < size:
            raise SilenceError(
                f"sent a packet and got {len(data)} of {size} bytes; is the robot on, in the"
                " network, and its selector at 15?",
                sent,
                data[:40],
            )
        if data[0] != head:
            raise GarbageError(f"a packet begins with {data[0]:#04x}: is this an e-puck2?", sent)
        return data[1:]

    def clear(self, data: bytes = b"") -> None:
        """Send a packet, and drop what comes until it is quiet.

        Raises:
            LinkError: the port failed.
            GarbageError: what is on it never pauses.
        """
        try:
            self.port.write(data or _STOP)
            start, came = self.clock(), b"x"
            while came or self.clock() - start < QUIET:
                if self.clock() - start > BABBLE:
                    raise GarbageError(f"bytes have not stopped coming for {BABBLE} s", data, came)
                came = bytes(self.port.read(256))
        except PORT_ERRORS as error:
            raise port_failed(data, error) from None


class WifiEpuck(SteeredEpuck[WifiLine]):
    """An e-puck2 on WiFi; see `SteeredEpuck`.

    Args:
        port: an open pySerial port, such as `socket://`.
        reopen: opens that port again after it has failed; None: it cannot be.
    """

    def __init__(self, port: Any, reopen: Callable[[], Any] | None = None) -> None:
        super().__init__(port, reopen, WifiLine, _stand, _STOP)

    def connect(self) -> tuple[str, ...]:
        """Stop the robot, and see where the counters are.

        Raises:
            RobotError: nothing answers like an e-puck2 on WiFi.
        """
        self._line.clear()
        self._begin()
        return ("e-puck2 on WiFi",)

    def battery(self) -> float | None:
        """Return the battery's voltage."""
        sensors = self._repeated(lambda: self._metered(lambda: self._line.ask((0, 0))), _STOP)
        return volts_of(sensors.battery, second=True)

    def picture(self) -> Image:
        """Stand and take a picture of the robot's camera; see `Seeing`."""
        pixels = self._repeated(lambda: self._metered(self._line.picture), _STOP)
        return image_of(pixels, WIDTH, HEIGHT)

    def _ask(self, speeds: Pair) -> Seen:
        sensors = self._line.ask(speeds)
        return Seen(sensors.proximity, sensors.steps)

    def _read_steps(self) -> Pair:
        return self._line.ask((0, 0)).steps


def _stand(line: WifiLine) -> None:
    line.clear(_STOP)
    before = line.ask((0, 0)).steps
    line.pause(_STANDING)
    if line.ask((0, 0)).steps != before:
        raise GarbageError("told to stop, and the step counters go on", _STOP)
