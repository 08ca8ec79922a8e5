"""Characters on a wire: what a receiver makes of a sender with other settings.

The sender's characters become levels, a bit time each; the receiver waits for a falling edge and
samples in the middle of its own bit times, as a UART does. Within five per cent both agree, and
at half or twice the rate the receiver reads garbage.

A receiver without a parity bit takes what it samples, as a UART and a terminal do. One that
checks parity reads a character with a wrong parity or stop bit as NUL, as a Linux terminal does
(INPCK without IGNPAR). No I/O.
"""

from dataclasses import dataclass
from itertools import repeat
from typing import Final

_IDLE, _START = 1, 0

PARITIES: Final = "NEOMS"
"""None, even, odd, mark (always 1) and space (always 0), as pySerial names them."""


@dataclass(frozen=True, slots=True)
class LineFormat:
    """Settings of one end of a line.

    Attributes:
        baud: bits a second.
        bits: data bits in a character, 5 to 8.
        parity: one of `PARITIES`.
        stop: stop bits; a receiver looks at the first one only.
    """

    baud: int
    bits: int = 8
    parity: str = "N"
    stop: float = 1

    def __str__(self) -> str:
        """Name them as is usual: 9600 8N1."""
        return f"{self.baud} {self.bits}{self.parity}{self.stop:g}"

    def matches(self, other: "LineFormat") -> bool:
        """Tell whether both ends understand each other exactly."""
        return (self.baud, self.bits, self.parity) == (other.baud, other.bits, other.parity)

    @property
    def frame(self) -> int:
        """Bit times of a character, from its start bit to the end of its stop bits."""
        return 1 + self.bits + (self.parity != "N") + (1 if self.stop == 1 else 2)


@dataclass(frozen=True, slots=True)
class Heard:
    """A character as it was received.

    Attributes:
        start: seconds from the sender's first start bit to this character's.
        byte: what the receiver makes of it.
    """

    start: float
    byte: int


def receive(data: bytes, sender: LineFormat, receiver: LineFormat) -> list[Heard]:
    """Return what arrives of bytes that are sent one after the other on a line that was idle."""
    levels = _levels(data, sender)
    ratio = sender.baud / receiver.baud
    heard: list[Heard] = []
    position = 0
    while (edge := _find(levels, _START, position)) is not None:
        if _sample(levels, edge + 0.5 * ratio) == _IDLE:
            position = edge + 1  # a spike, no start bit
            continue
        byte, stop = _character(levels, edge, ratio, receiver)
        heard.append(Heard(edge / sender.baud, byte))
        # the next start bit is a falling edge: after a low stop bit the line has to rise first
        high = _find(levels, _IDLE, int(stop))
        if high is None:
            break
        position = high
    return heard


def _parity_bit(byte: int, parity: str) -> int:
    odd = byte.bit_count() & 1
    return {"E": odd, "O": 1 - odd, "M": 1, "S": 0}[parity]


def _levels(data: bytes, sender: LineFormat) -> list[int]:
    """Return levels of the line, one a bit time; one and a half stop bits are sent as two."""
    levels: list[int] = []
    for byte in data:
        value = byte & ((1 << sender.bits) - 1)
        levels.append(_START)
        levels.extend(value >> place & 1 for place in range(sender.bits))
        if sender.parity != "N":
            levels.append(_parity_bit(value, sender.parity))
        levels.extend(repeat(_IDLE, sender.frame - len(levels) % sender.frame))
    return levels


def _character(
    levels: list[int], edge: int, ratio: float, receiver: LineFormat
) -> tuple[int, float]:
    """Read the character that begins at an edge, and where its stop bit was sampled."""
    places = [edge + (1.5 + bit) * ratio for bit in range(receiver.bits)]
    byte = sum(_sample(levels, place) << bit for bit, place in enumerate(places))
    after = places[-1] + ratio
    if receiver.parity == "N":
        return byte, after
    stop = after + ratio
    right = _sample(levels, after) == _parity_bit(byte, receiver.parity)
    return (byte if right and _sample(levels, stop) == _IDLE else 0), stop


def _sample(levels: list[int], place: float) -> int:
    index = int(place)
    return levels[index] if index < len(levels) else _IDLE


def _find(levels: list[int], level: int, position: int) -> int | None:
    try:
        return levels.index(level, position)
    except ValueError:
        return None
