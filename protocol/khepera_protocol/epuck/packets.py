"""The two packets that an e-puck2 is driven by: all sensors, and all actuators."""

import struct
from dataclasses import dataclass
from enum import IntFlag
from typing import Final, Self

from khepera_protocol.epuck.codes import ACTUATORS_SIZE, SENSORS_SIZE

_SENSORS: Final = struct.Struct("<3h3f3h3fb8H8HH4H2hHBBBBB3H3HB")
assert _SENSORS.size == SENSORS_SIZE

_ACTUATORS: Final = struct.Struct("<B2hB12BB")
assert _ACTUATORS.size == ACTUATORS_SIZE

Triple = tuple[int, int, int]
Reals = tuple[float, float, float]


class PacketError(ValueError):
    """Bytes are no packet; the message says why."""


@dataclass(frozen=True, slots=True)
class AllSensors:
    """Answer to 0xF8, 103 bytes.

    Attributes:
        acceleration: x, y, z, offsets removed; 1 g is about 768.
        tilt: length of the acceleration, and orientation and inclination in degrees.
        gyro: x, y, z, 131 digits a degree a second.
        magnetic: x, y, z in uT.
        temperature: degrees C.
        proximity, ambient: of the eight sensors.
        distance: time of flight, mm.
        volumes: of four microphones.
        steps: low words of both counters, signed.
        battery: raw.
        card: 1 if there is a micro SD card.
        remote: toggle, address and data of the infrared remote control.
        selector: 0 to 15.
        ground, ground_ambient: of the three ground sensors.
        last: a byte that is 0; the button, on WiFi.
    """

    acceleration: Triple
    tilt: Reals
    gyro: Triple
    magnetic: Reals
    temperature: int
    proximity: tuple[int, ...]
    ambient: tuple[int, ...]
    distance: int
    volumes: tuple[int, ...]
    steps: tuple[int, int]
    battery: int
    card: int
    remote: Triple
    selector: int
    ground: Triple
    ground_ambient: Triple
    last: int = 0

    def pack(self) -> bytes:
        """Return the packet's bytes.

        Raises:
            PacketError: a number does not fit.
        """
        try:
            return _SENSORS.pack(
                *self.acceleration,
                *self.tilt,
                *self.gyro,
                *self.magnetic,
                self.temperature,
                *self.proximity,
                *self.ambient,
                self.distance,
                *self.volumes,
                *self.steps,
                self.battery,
                self.card,
                *self.remote,
                self.selector,
                *self.ground,
                *self.ground_ambient,
                self.last,
            )
        except struct.error as error:
            raise PacketError(f"these sensors fit no packet: {error}") from None

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Read a packet.

        Raises:
            PacketError: it has another size.
        """
        if len(data) != SENSORS_SIZE:
            raise PacketError(f"a packet of sensors has {SENSORS_SIZE} bytes, not {len(data)}")
        v = _SENSORS.unpack(data)
        return cls(
            v[0:3], v[3:6], v[6:9], v[9:12], v[12], v[13:21], v[21:29], v[29], v[30:34], v[34:36],
            v[36], v[37], v[38:41], v[41], v[42:45], v[45:48], v[48],
        )  # fmt: skip


class Behaviour(IntFlag):
    """First byte of the actuators."""

    CALIBRATE = 1
    """Take the proximity sensors' zero anew."""
    AVOID = 2
    """Avoid obstacles by itself; without it, do not."""
    STEPS = 4
    """The two numbers set the step counters, and not the speeds."""


class Sound(IntFlag):
    """Last byte of the actuators."""

    MARIO = 1
    UNDERWORLD = 2
    STAR_WARS = 4
    HIGH_TONE = 8
    LOW_TONE = 0x10
    STOP = 0x20


_CALM: Final = Behaviour(0)
_QUIET: Final = Sound(0)

LEDS: Final = ("LED 1", "LED 3", "LED 5", "LED 7", "body", "front")
"""Bits of the byte of LEDs, the lowest first; LED 1 is the front one of the ring."""


@dataclass(frozen=True, slots=True)
class Actuators:
    """Parameters of 0xF7, 19 bytes.

    Attributes:
        behaviour: flags.
        wheels: speeds in steps a second, or step counters.
        leds: bits, see `LEDS`.
        colours: red, green and blue, 0 to 100 each, of LED 2, 4, 6 and 8.
        sound: flags.
    """

    behaviour: Behaviour = _CALM
    wheels: tuple[int, int] = (0, 0)
    leds: int = 0
    colours: tuple[int, ...] = (0,) * 12
    sound: Sound = _QUIET

    def pack(self) -> bytes:
        """Return the packet's bytes.

        Raises:
            PacketError: a number does not fit.
        """
        try:
            return _ACTUATORS.pack(
                self.behaviour, *self.wheels, self.leds, *self.colours, self.sound
            )
        except struct.error as error:
            raise PacketError(f"these actuators fit no packet: {error}") from None

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Read a packet.

        Raises:
            PacketError: it has another size.
        """
        if len(data) != ACTUATORS_SIZE:
            raise PacketError(f"a packet of actuators has {ACTUATORS_SIZE} bytes, not {len(data)}")
        behaviour, left, right, leds, *colours, sound = _ACTUATORS.unpack(data)
        return cls(Behaviour(behaviour), (left, right), leds, tuple(colours), Sound(sound))
