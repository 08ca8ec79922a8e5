"""Order of time in what passes on a serial line."""

from collections.abc import Callable
from heapq import heappop, heappush
from math import inf
from typing import Protocol

from khepera_emulator.line.coding import LineFormat
from khepera_emulator.line.fault import Happening


class WireListener(Protocol):
    """Listener to what passes on a line; see `wire_log.WireLog`."""

    def request(self, time: float, data: bytes) -> None:
        """Take what a client has written."""

    def reply(self, time: float, data: bytes) -> None:
        """Take bytes that have reached the client."""

    def close(self, time: float) -> None:
        """Take notice that the client has left."""

    def line(self, time: float, line: LineFormat | None) -> None:
        """Take the client's settings."""

    def fault(self, happening: Happening) -> None:
        """Take a fault that has happened."""


class InOrder:
    """Order of time for listeners: they are told all when its time has come.

    A reply is handed over a moment after it has arrived, when a later request may be known already;
    a fault is known ahead of the byte that it delays.

    Args:
        listeners: are told one after the other.
    """

    def __init__(self, *listeners: WireListener) -> None:
        self._listeners = listeners
        self._waiting: list[tuple[float, int, Callable[[WireListener, float], None]]] = []
        self._count = 0
        self._latest = 0.0

    def request(self, time: float, data: bytes) -> None:
        """Tell that a client has written."""
        self._put(time, lambda listener, when: listener.request(when, data))

    def reply(self, time: float, data: bytes) -> None:
        """Tell that bytes have reached the client."""
        self._put(time, lambda listener, when: listener.reply(when, data))

    def close(self, time: float) -> None:
        """Tell that the client has left."""
        self._put(time, lambda listener, when: listener.close(when))

    def line(self, time: float, line: LineFormat | None) -> None:
        """Tell the client's settings."""
        self._put(time, lambda listener, when: listener.line(when, line))

    def fault(self, happening: Happening) -> None:
        """Tell that a fault has happened."""
        self._put(happening.time, lambda listener, _: listener.fault(happening))

    def pass_on(self, until: float = inf) -> None:
        """Tell all that has happened by a time."""
        waiting = self._waiting
        while waiting and waiting[0][0] <= until:
            time, _, tell = heappop(waiting)
            # what was handed over later than expected was told later, too
            self._latest = max(self._latest, time)
            for listener in self._listeners:
                tell(listener, self._latest)

    def _put(self, time: float, tell: Callable[[WireListener, float], None]) -> None:
        self._count += 1
        heappush(self._waiting, (time, self._count, tell))
