"""Binary requests: a row of command bytes with their parameters, ended by 0.

A command byte is the two's complement of a letter, or of a small number on the e-puck2. All answers
of a row are put together and sent after the 0. Numbers are little-endian.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

END: Final = 0
"""Byte that ends a row."""

SOUND_BUFFER: Final = 600
"""Bytes of the microphones' buffer that U sends by itself, ahead of the row's answer."""

PICTURE_HEAD: Final = 3
"""Bytes ahead of a picture: mode, width and height."""


@dataclass(frozen=True, slots=True)
class Code:
    """A command in a row.

    Attributes:
        byte: the command byte.
        name: letter, or the byte in hexadecimal.
        title: what it is for.
        parameters: bytes that follow it.
        answer: bytes that it adds to the row's answer; None: it depends (a picture).
    """

    byte: int
    name: str
    title: str
    parameters: int = 0
    answer: int | None = 0


Codes = MappingProxyType[int, Code]
"""Codes by their bytes."""


def byte_of(letter: str) -> int:
    """Return the command byte of a letter."""
    return 0x100 - ord(letter)


def _letter(letter: str, title: str, parameters: int = 0, answer: int | None = 0) -> Code:
    return Code(byte_of(letter), letter, title, parameters, answer)


def _number(number: int, title: str, parameters: int = 0, answer: int = 0) -> Code:
    byte = 0x100 - number
    return Code(byte, f"0x{byte:02X}", title, parameters, answer)


def _table(*codes: Code) -> Codes:
    return MappingProxyType({code.byte: code for code in codes})


_BOTH: Final = (
    _letter("a", "Read acceleration, as A in text", answer=6),
    _letter("A", "Read acceleration as length, orientation and inclination, floats", answer=12),
    _letter("D", "Set speed", 4),
    _letter("E", "Read the speed that was set", answer=4),
    _letter("I", "Take a picture", answer=None),
    _letter("L", "Change an LED: 0 to 7, 8 body, 9 front, others all eight", 2),
    _letter("N", "Read proximity", answer=16),
    _letter("O", "Read ambient light", answer=16),
    _letter("Q", "Read step counters", answer=4),
    _letter("u", "Read microphone volumes", answer=6),
)

BTCOM_CODES: Final = _table(
    *_BOTH,
    _letter("M", "Read floor sensors", answer=6),
    _letter("U", "Read the microphones' buffer", answer=1),
)
"""Those of BTcom."""

_GCTRONIC = (
    *_BOTH,
    _letter("b", "Read battery", answer=2),
    _letter("g", "Read gyroscope", answer=6),
    _letter("P", "Set step counters", 4),
    _letter("t", "Read temperature", answer=1),
    _letter("W", "Write to the bus", 3),
    _letter("w", "Write to the RGB panel", 35),
)

EPUCK_CODES: Final = _table(
    *_GCTRONIC,
    _letter("M", "Read ground and cliff sensors", answer=10),
    _letter("U", "Read the microphones' buffer", answer=1),
)
"""Those of the e-puck's firmware of GCtronic."""

ALL_SENSORS: Final = 0xF8
ALL_ACTUATORS: Final = 0xF7
ACTUATORS_SIZE: Final = 19
SENSORS_SIZE: Final = 103

EPUCK2_CODES: Final = _table(
    *_GCTRONIC,
    _letter("M", "Read ground sensors and one cliff sensor", answer=8),
    _letter("U", "Do nothing"),
    _letter("Y", "Read from the bus", 2, 1),
    _number(0x08, "Read all sensors", answer=SENSORS_SIZE),
    _number(0x09, "Set all actuators", ACTUATORS_SIZE),
    _number(0x0A, "Set the four RGB LEDs", 12),
    _number(0x0B, "Read button", answer=1),
    _number(0x0C, "Read four microphone volumes", answer=8),
    _number(0x0D, "Read time of flight, mm", answer=2),
    _number(0x0E, "Read whether there is a micro SD card", answer=1),
    _number(0x0F, "Switch the magnetometer", 1, 1),
    _number(0x10, "Switch the proximity sensors: off, fast, slow", 1, 1),
    _number(0x11, "Switch the time of flight sensor", 1, 1),
)
"""Those of the e-puck2's main processor."""


def row(*commands: int | str | tuple[int | str, bytes]) -> bytes:
    """Return a row of commands with its end.

    Args:
        commands: letters or bytes, with their parameters where they have some.
    """
    return b"".join(map(_command, commands)) + bytes([END])


def _command(command: int | str | tuple[int | str, bytes]) -> bytes:
    name, parameters = command if isinstance(command, tuple) else (command, b"")
    byte = byte_of(name) if isinstance(name, str) else name
    return bytes([byte]) + parameters


def pack(values: Iterable[int]) -> bytes:
    """Return 16-bit numbers as a row has them; only their low 16 bits count."""
    return b"".join((value & 0xFFFF).to_bytes(2, "little") for value in values)


def unpack(data: bytes, *, signed: bool = False) -> tuple[int, ...]:
    """Return the 16-bit numbers in the bytes of an answer; a single byte behind them is left."""
    ends = range(0, len(data) - 1, 2)
    return tuple([int.from_bytes(data[at : at + 2], "little", signed=signed) for at in ends])
