"""The interface of a port: the client's end of the serial line, whatever carries it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, Self

from khepera_emulator.line.coding import LineFormat


@dataclass(frozen=True, slots=True)
class PortRequest:
    """Wish for a port.

    Attributes:
        address: as it was given, such as HOST:PORT; empty: none.
        number: of the robot among those that share a world, from 0.
        expose: whether addresses are allowed that other machines can reach.
        moved: is told a new URL, if the port ever gets one.
    """

    address: str
    number: int
    expose: bool
    moved: Callable[[str], None]


class Port(Protocol):
    """Client side of a robot's line; nothing here waits.

    Attributes:
        dropped: bytes to clients that did not fit because they do not read.
    """

    dropped: int

    @classmethod
    def opened(cls, request: PortRequest) -> Self:
        """Open one.

        Raises:
            EmulatorError: the address is none, or the system refuses.
        """

    @property
    def url(self) -> str:
        """URL or path that a pySerial client opens."""

    def descriptors(self, *, room: bool, answered: bool = True) -> tuple[int, ...]:
        """Return descriptors that become readable when clients come, write or leave.

        Args:
            room: whether bytes will be taken; without it a client that writes wakes nobody.
            answered: as for `receive`.
        """

    def settings(self) -> LineFormat | None:
        """Return what the client has set; None if nothing tells."""

    def receive(self, limit: int, *, answered: bool = True) -> list[bytes]:
        """Return what clients have done since the last call, in order.

        Args:
            limit: bytes to take at most; the rest stays with the client.
            answered: whether nothing more is to be said about the bytes that were taken so far: a
                client that waits for replies alone may go.

        Returns:
            Bytes that were written; an empty chunk says that the client has left.
        """

    def changed(self) -> bool:
        """Tell whether what is handed over now could reach another client than the one last seen.

        The next `receive` tells who has come and left.
        """

    def write(self, data: bytes) -> None:
        """Hand bytes to the client; what it has no room for is dropped and counted."""

    def close(self) -> None:
        """Hang up."""
