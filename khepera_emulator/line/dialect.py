"""A robot's end of a serial line: its characters, its buffers, and where one of its requests ends.

Everything else on a line is the same for all kinds of robots: `uart`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

from khepera_protocol.serial.framing import RequestSplitter

from khepera_emulator.line.clock import on_grid


class Splitter(Protocol):
    """Cuts what a client sends into requests; one belongs to one line, whose state it holds."""

    def end(self, data: bytearray, limit: int) -> int:
        """Find where the next portion ends: bytes of which only the last can complete a request.

        Args:
            data: what comes next, behind what was taken before.
            limit: so many of its bytes count.

        Returns:
            The number of bytes up to there; 0 if that lies beyond the limit.
        """

    def take(self, data: bytes) -> Any:
        """Take in a portion, or a part of one; return the request that is complete now, or None."""

    def clear(self) -> None:
        """Forget what is half received."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """Properties of a robot's end of the line.

    Attributes:
        splitter: makes what cuts a line into requests.
        restart: the request to start again, which a fault that resets the robot comes as.
        first_rate: bits a second that the line shows until a client sets another rate.
        stop: stop bits of a character.
        busy: seconds between the end of a request and the first bit of its reply.
        receive_limit: bytes that the robot holds before its interpreter takes them; more are lost.
        send_limit: bytes of replies that wait for the line; a whole reply that does not fit is
            lost.
        serial: whether clients set a rate; a network's is its own.
        name: tells ways of speaking of one kind of robots apart; empty: there is one.
    """

    splitter: Callable[[], Splitter]
    restart: Any
    first_rate: int
    stop: int
    busy: float
    receive_limit: int
    send_limit: int
    serial: bool = True
    name: str = ""

    def character(self, rate: int) -> float:
        """Return the seconds of a character at a rate: start bit, 8 data bits, stop bits."""
        return on_grid((9 + self.stop) / rate)


KHEPERA: Final = Dialect(
    splitter=RequestSplitter,
    restart=b"restart",  # the ROM's tool that does what its reset button does
    first_rate=9600,  # mode 1 of its jumpers
    stop=2,
    busy=on_grid(0.0015),  # a choice
    receive_limit=256,
    send_limit=4096,
)
"""The Khepera's, which is that of a robot of which nothing else is said."""
