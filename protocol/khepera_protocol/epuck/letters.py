"""Requests in text: a letter and its numbers, separated by commas, ended by CR, LF or both."""

import re
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

LINE_END: Final = b"\r\n"

NOT_FOUND: Final = "z,Command not found"
"""Answer to a letter that the firmware does not know."""

CALIBRATING: Final = "k, Starting calibration - Remove any object in sensors range"
CALIBRATED: Final = "k, Calibration finished"
"""The two lines of K, the second one when it is done."""

GREETING: Final = (
    b'\x0c\x07WELCOME to the SerCom protocol on e-Puck\r\nthe EPFL education robot type "H" for'
    b" help\r\n"
)
"""Bytes that the robot sends when it is switched on."""


@dataclass(frozen=True, slots=True)
class Letter:
    """A request in text.

    Attributes:
        letter: as the firmware has it after turning it into a capital, but for `b` and `g`.
        title: what it is for.
        request: numbers behind it; those in parentheses may be absent.
        reply: numbers in the reply; none: the letter alone, or a text.
        shape: the reply, where it is not the small letter with its numbers.
    """

    letter: str
    title: str
    request: tuple[str, ...] = ()
    reply: tuple[str, ...] = ()
    shape: str = ""


def _each(name: str, count: int) -> tuple[str, ...]:
    return tuple(f"{name} {number}" for number in range(count))


_PAIR = ("left", "right")
_AXES = ("x", "y", "z")
_ACTION = "0 off, 1 on, more: toggle"

_TABLE = (
    Letter("A", "Read acceleration", (), _AXES),
    Letter("B", "Set the body's LED", (_ACTION,)),
    Letter("b", "Read battery", (), ("raw",), "b,RAW (PERCENT%) or b,OK"),
    Letter("C", "Read selector", (), ("position",)),
    Letter("D", "Set speed, steps a second", _PAIR),
    Letter("E", "Read the speed that was set", (), _PAIR),
    Letter("F", "Set the front LED", (_ACTION,)),
    Letter(
        "G", "Read infrared remote control", shape="g IR check : 0xC, address : 0xA, data : 0xD"
    ),
    Letter("g", "Read gyroscope", (), _AXES),
    Letter("H", "Help", shape="LF, and a line for each letter"),
    Letter("I", "Read camera parameters", (), ("mode", "width", "height", "zoom", "size")),
    Letter(
        "J",
        "Set camera parameters",
        ("mode: 0 grey, 1 RGB565, 2 YUV", "width", "height", "zoom", "(left)", "(top)"),
    ),
    Letter("K", "Calibrate proximity", shape="two lines, the second one when it is done"),
    Letter("L", "Set an LED", ("0 to 7; others: all eight", _ACTION)),
    Letter(
        "M", "Read ground sensors", (), ("left", "middle", "right", "cliff left", "cliff right")
    ),
    Letter("N", "Read proximity", (), _each("p", 8)),
    Letter("O", "Read ambient light", (), _each("p", 8)),
    Letter("P", "Set step counters", _PAIR),
    Letter("Q", "Read step counters", (), _PAIR),
    Letter("R", "Reset", shape="r, and the greeting"),
    Letter("S", "Stop: speed 0, the eight LEDs off"),
    Letter("T", "Play a sound", ("1 to 5; others: stop",)),
    Letter("U", "Read microphone volumes", (), _each("microphone", 3)),
    Letter("V", "Read version", shape="v,Version ... and a line with that of the hardware"),
    Letter("W", "Write to the bus", ("module", "register", "value")),
    Letter("X", "Ask for so many bytes", ("count",), shape="x, and so many digits 1"),
    Letter("Y", "Read from the bus", ("module", "register"), shape="y,MODULE,REGISTER and y,VALUE"),
    Letter("Z", "Scan the bus", shape="ADDRESS: VALUE lines, of those that answer"),
)

LETTERS: Final = MappingProxyType({row.letter: row for row in _TABLE})
"""The table by letter. The firmware has a `t` (temperature), which becomes T before it is read."""

_NUMBER: Final = re.compile(rb"[ \t\n\v\f\r]*([+-]?)([0-9]+)")
_DIGITS: Final = 32
"""Digits that decide the low 32 bits of a number."""


@dataclass(frozen=True, slots=True)
class Line:
    """A request in text, as it has come, without its end."""

    text: bytes

    @property
    def letter(self) -> str:
        """The letter as it stands there."""
        return chr(self.text[0])

    def numbers(self, letter: str, most: int, bits: int) -> list[int]:
        """Read the numbers behind the letter as the C library's `sscanf` does.

        Args:
            letter: what the line must begin with.
            most: so many numbers at most.
            bits: of the robot's int, in which they wrap.

        Returns:
            Those that could be read; reading ends at the first that cannot.
        """
        found: list[int] = []
        at = 1
        if self.letter.upper() != letter:
            return found
        while len(found) < most and self.text[at : at + 1] == b",":
            match = _NUMBER.match(self.text, at + 1)
            if match is None:
                break
            sign, digits = match[1], match[2]
            value = int(digits[-_DIGITS:])
            found.append(wrapped(-value if sign == b"-" else value, bits))
            at = match.end()
        return found


def wrapped(value: int, bits: int) -> int:
    """Return a number as a signed one of so many bits holds it."""
    half = 1 << (bits - 1)
    return (value + half) % (2 * half) - half


def request(letter: str, *numbers: int, end: bytes = b"\r") -> bytes:
    """Return a request as bytes on the line.

    Args:
        letter: a key of `LETTERS`.
        numbers: behind it.
        end: CR, behind which a binary row may follow at once; after a CR LF it would be lost.
    """
    return ",".join((letter, *map(str, numbers))).encode("ascii") + end


_INTEGER: Final = re.compile(rb"-?[0-9]{1,10}")


def reply_numbers(letter: str, line: bytes) -> tuple[int, ...]:
    """Return the numbers in the reply to a request, without its line end.

    Raises:
        ValueError: a reply to something else, or no numbers; it says what is wrong.
    """
    head, *words = line.split(b",")
    if letter == "b" and words:
        words = words[:1] if len(words) > 1 else words[0].split(b" ")[:1]
    expected = letter.lower().encode("ascii")
    if head != expected:
        raise ValueError(f"{line[:60]!r} is no reply to {letter}")
    count = len(LETTERS[letter].reply)
    if letter == "M" and len(words) == count - 2:  # BTcom has no cliff sensors
        count -= 2
    if len(words) != count:
        raise ValueError(f"{line[:60]!r}: {count} value(s) expected, got {len(words)}")
    if not all(_INTEGER.fullmatch(word) for word in words):
        raise ValueError(f"{line[:60]!r}: integers expected")
    return tuple(map(int, words))
