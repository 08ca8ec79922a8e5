"""Packets of an e-puck2 on WiFi: 21 bytes to the robot; a head, and what was asked for, from it.

Source: Webots' client and another one, which agree; the firmware of the robot's WiFi side was not
found.
"""

from dataclasses import dataclass, field
from typing import Final, Self

from khepera_protocol.epuck.codes import SENSORS_SIZE
from khepera_protocol.epuck.packets import Actuators, PacketError

WIFI: Final = "wifi"
"""Name of this way of speaking."""

REQUEST_HEAD: Final = 0x80
REQUEST_SIZE: Final = 21

PICTURE, SENSORS, EMPTY = 0x01, 0x02, 0x03
"""Heads of what the robot sends."""

WIDTH, HEIGHT = 160, 120
"""Size of a picture, RGB565."""

SIZES: Final = {PICTURE: WIDTH * HEIGHT * 2, SENSORS: SENSORS_SIZE + 1, EMPTY: 0}
"""Bytes behind a head. Behind sensors the button comes last but one, and an empty byte."""


@dataclass(frozen=True, slots=True)
class WifiRequest:
    """A packet to the robot.

    Attributes:
        pictures: whether the robot shall send pictures, from now on.
        sensors: whether it shall send its sensors.
        actuators: what it shall do.
    """

    pictures: bool = False
    sensors: bool = True
    actuators: Actuators = field(default_factory=Actuators)

    def pack(self) -> bytes:
        """Return the packet's bytes.

        Raises:
            PacketError: a number does not fit.
        """
        asked = self.pictures + 2 * self.sensors
        return bytes([REQUEST_HEAD, asked]) + self.actuators.pack()

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Read a packet.

        Raises:
            PacketError: it is none.
        """
        if len(data) != REQUEST_SIZE or data[0] != REQUEST_HEAD:
            raise PacketError(f"{data[:4]!r}... ({len(data)} bytes) is no request of 21 bytes")
        return cls(bool(data[1] & 1), bool(data[1] & 2), Actuators.unpack(data[2:]))


class WifiSplitter:
    """Cuts what a client sends into requests; bytes ahead of a head are dropped."""

    def __init__(self) -> None:
        self._held = bytearray()

    def end(self, data: bytearray, limit: int) -> int:
        """Find where the next portion ends; see `framing.RequestSplitter.end`."""
        if not self._held and limit and data[0] != REQUEST_HEAD:
            at = data.find(REQUEST_HEAD, 0, limit)
            return at if at >= 0 else limit
        size = REQUEST_SIZE - len(self._held)
        return size if size <= limit else 0

    def take(self, data: bytes) -> WifiRequest | None:
        """Take in a portion, or a part of one; return the request that is complete now."""
        if not self._held and data[:1] != bytes([REQUEST_HEAD]):
            return None
        self._held += data
        if len(self._held) < REQUEST_SIZE:
            return None
        request = WifiRequest.unpack(bytes(self._held))
        self._held.clear()
        return request

    def clear(self) -> None:
        """Forget what is half received."""
        self._held.clear()


class WifiReader:
    """Cuts what a robot sends into packets: pairs of a head and what follows it."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Take in bytes; return the packets completed by them.

        Raises:
            PacketError: what comes begins with no head.
        """
        self._rest += data
        packets = []
        while self._rest:
            head = self._rest[0]
            if head not in SIZES:
                raise PacketError(f"a packet begins with {head:#04x}, which is no head")
            end = 1 + SIZES[head]
            if len(self._rest) < end:
                break
            packets.append((head, self._rest[1:end]))
            self._rest = self._rest[end:]
        return packets
