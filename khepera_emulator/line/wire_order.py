"""What passes on a serial line, put in the order of its times."""

from collections.abc import Callable
from heapq import heappop, heappush
from math import inf
from typing import Protocol

from khepera_emulator.line.coding import LineFormat
from khepera_emulator.line.faults import Happening


class WireListener(Protocol):
    """Is told what passes on a line; see `wire_log.WireLog`."""

    def request(self, time: float, data: bytes) -> None:
        """A client has written."""

    def reply(self, time: float, data: bytes) -> None:
        """Bytes have reached the client."""

    def close(self, time: float) -> None:
        """The client has left."""

    def line(self, time: float, line: LineFormat | None) -> None:
        """The client's settings."""

    def fault(self, happening: Happening) -> None:
        """A fault has happened."""


class InOrder:
    """Tells a listener what it is told itself, in the order of the times, when they have come.

    A reply is handed over a moment after it has arrived, when a later request may be known already;
    a fault is known ahead of the byte that it delays.

    Args:
        listener: who is told.
    """

    def __init__(self, listener: WireListener) -> None:
        self._listener = listener
        self._waiting: list[tuple[float, int, Callable[[float], None]]] = []
        self._count = 0
        self._latest = 0.0

    def request(self, time: float, data: bytes) -> None:
        """A client has written."""
        self._put(time, lambda when: self._listener.request(when, data))

    def reply(self, time: float, data: bytes) -> None:
        """Bytes have reached the client."""
        self._put(time, lambda when: self._listener.reply(when, data))

    def close(self, time: float) -> None:
        """The client has left."""
        self._put(time, self._listener.close)

    def line(self, time: float, line: LineFormat | None) -> None:
        """The client's settings."""
        self._put(time, lambda when: self._listener.line(when, line))

    def fault(self, happening: Happening) -> None:
        """A fault has happened."""
        self._put(happening.time, lambda _: self._listener.fault(happening))

    def pass_on(self, until: float = inf) -> None:
        """Tell all that has happened by a time."""
        waiting = self._waiting
        while waiting and waiting[0][0] <= until:
            time, _, tell = heappop(waiting)
            # what was handed over later than expected was told later, too
            self._latest = max(self._latest, time)
            tell(self._latest)

    def _put(self, time: float, tell: Callable[[float], None]) -> None:
        self._count += 1
        heappush(self._waiting, (time, self._count, tell))
