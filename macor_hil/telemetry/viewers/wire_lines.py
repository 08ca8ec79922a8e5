"""Lines of a serial line, put together from the pieces that its watchers are told."""

from collections.abc import Iterator
from typing import Final, NamedTuple

from khepera_protocol.zenoh.payloads import Wire

REQUEST: Final = "request"
REPLY: Final = "reply"

_LONGEST: Final = 200
"""Characters of a line that are kept until its end comes."""


_DIGITS: Final = 12
"""Characters of a number at most."""


class WireLine(NamedTuple):
    """A whole line, without its end, or an event that is not said on the line.

    Attributes:
        what: request or reply; for other events their kind, such as fault.
        text: its bytes as the characters U+0000 to U+00FF; of other events, what they did.
    """

    what: str
    text: str

    @property
    def said(self) -> bool:
        """True for what robot or client said."""
        return self.what in (REQUEST, REPLY)


class WireLines:
    """Puts pieces together, each way on its own."""

    def __init__(self) -> None:
        self._begun: dict[str, str] = {}

    def take(self, wire: Wire) -> Iterator[WireLine]:
        """Yield what has come to its end."""
        for entry in wire.entries:
            if entry.what not in (REQUEST, REPLY):
                yield WireLine(entry.what, entry.text)
                continue
            *lines, rest = (self._begun.get(entry.what, "") + entry.text).split("\n")
            self._begun[entry.what] = rest[-_LONGEST:]
            for line in lines:
                yield WireLine(entry.what, line.rstrip("\r"))


class Readings:
    """Readings of the robot's sensors as they pass on its line, whoever asks for them.

    Attributes:
        proximity: the latest reply to N, eight counts; None before.
        counters: the latest reply to H; None before.
        battery: counts of A/D input 0, the latest reply to `I,0`; None before.
    """

    def __init__(self) -> None:
        self.proximity: tuple[int, ...] | None = None
        self.counters: tuple[int, int] | None = None
        self.battery: int | None = None
        self._channel = ""

    def take(self, line: WireLine) -> str:
        """Take in a line; return the letter of the reply that was one of those, or nothing."""
        letter, *words = line.text.replace(" ", "").split(",")
        if line.what == REQUEST:
            if letter == "I":
                self._channel = ",".join(words)
            return ""
        try:
            values = tuple(int(word) for word in words if len(word) < _DIGITS)
        except ValueError:
            return ""
        match letter, values:
            case "n", (_, _, _, _, _, _, _, _):
                self.proximity = values
            case "h", (left, right):
                self.counters = left, right
            case "i", (value,) if self._channel == "0":
                self.battery = value
            case _:
                return ""
        return letter
