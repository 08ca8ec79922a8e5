"""The serial line in time: when a byte has arrived, and when a byte of the answer leaves.

All times are seconds on the robot's clock. A byte takes 11 bit times, in either direction; a
request is carried out when its last byte has arrived, one after the other. Without a rate
(`baud=None`) the line takes no time.

Every time is a multiple of `GRID`, a power of two: sums and differences of such numbers are
exact for 97 days, so that what happens after a moment does not depend on when that moment was.
"""

from collections import deque
from collections.abc import Iterator
from typing import Final

from protocol.framing import RequestSplitter
from protocol.units import wire_time

GRID: Final = 2.0**-30
"""Seconds between two moments that the line tells apart: about a nanosecond."""

RECEIVE_LIMIT: Final = 256
"""Bytes that the robot holds before its interpreter takes them; more are lost."""

SEND_LIMIT: Final = 4096
"""Bytes of replies that wait for the line; a whole reply that does not fit is lost."""

_LINE_END = b"\r\n"


def on_grid(seconds: float) -> float:
    """The nearest multiple of `GRID`."""
    return float(round(seconds / GRID)) * GRID


INTERPRETER_TIME: Final = on_grid(0.0015)
"""Seconds between the end of a request and the first bit of its reply (a choice)."""


class Uart:
    """Both directions of the robot's serial line.

    Attributes:
        lost: bytes dropped because a queue was full.
    """

    def __init__(self, baud: int | None) -> None:
        self.lost = 0
        self._receiver_free = self._interpreter_free = self._sender_free = 0.0
        self._orphans = 0
        self._unheard = False
        self.baud = baud
        self._splitter = RequestSplitter()
        self._receiving: deque[tuple[float, int]] = deque()
        self._held: deque[tuple[float, int]] = deque()
        self._sending = bytearray()
        self._due: deque[float] = deque()

    @property
    def baud(self) -> int | None:
        """Rate in bits a second, or None for a line that takes no time."""
        return self._baud

    @baud.setter
    def baud(self, rate: int | None) -> None:
        self._baud = rate
        self._each: float = on_grid(wire_time(1, rate)) if rate else 0.0
        self._busy = INTERPRETER_TIME if rate else 0.0

    def receive(self, data: bytes, now: float) -> None:
        """Bytes that the client puts on the line now; they arrive one after the other."""
        arrival = max(self._receiver_free, now)
        for byte in data:
            arrival += self._each
            self._receiving.append((arrival, byte))
        self._receiver_free = arrival

    def requests(self, until: float) -> Iterator[tuple[float, bytes]]:
        """Requests that the robot carries out by a time, with the times of their execution."""
        while self._receiving and self._receiving[0][0] <= until:
            arriving = self._receiving.popleft()
            if self._held:
                yield from self._interpret(arriving[0])
            if len(self._held) < RECEIVE_LIMIT:
                self._held.append(arriving)
            else:
                self.lost += 1
                self._take_orphan()
        yield from self._interpret(until)

    def send(self, data: bytes, executed: float) -> None:
        """A reply to the latest request, executed at a time: queue it behind earlier ones."""
        if self._unheard:
            return
        if len(self._sending) + len(data) > SEND_LIMIT:
            self.lost += len(data)
            return
        due = max(self._sender_free, executed + self._busy)
        for _ in data:
            due += self._each
            self._due.append(due)
        self._sending += data
        self._sender_free = due

    def sent(self, now: float, limit: int | None = None) -> bytes:
        """Take the bytes, at most `limit`, that have reached the client by now."""
        count = self.arrived(now)
        if limit is not None and limit < count:
            count = max(limit, 0)
        out = bytes(self._sending[:count])
        del self._sending[:count]
        for _ in range(count):
            self._due.popleft()
        return out

    def arrived(self, now: float) -> int:
        """How many bytes have reached the client by now and were not taken yet."""
        due = self._due
        if not due or due[0] > now:
            return 0
        if due[-1] <= now:
            return len(due)
        return next(count for count, when in enumerate(due) if when > now)

    def queued(self) -> int:
        """How many bytes of replies have reached the client or are on their way to it."""
        return len(self._sending)

    def find(self, text: bytes) -> int:
        """Where a text begins among the queued bytes; -1 if it is not there."""
        return self._sending.find(text)

    def due(self, count: int) -> float:
        """When the first `count` queued bytes have reached the client."""
        return self._due[count - 1]

    def next_event(self) -> float | None:
        """When the next byte arrives at either end or is interpreted; None for a silent line."""
        times = [self._interpreter_free] if self._held else []
        if self._receiving:
            times.append(self._receiving[0][0])
        if self._due:
            times.append(self._due[0])
        return min(times, default=None)

    def next_request(self) -> float | None:
        """When the robot may next carry out a request; None if no line is on its way."""
        if self._held:
            return self._interpreter_free
        return next((when for when, byte in self._receiving if byte in _LINE_END), None)

    def received_by(self) -> float:
        """When the last byte that the client has written arrives at the robot."""
        return self._receiver_free

    def arriving(self) -> int:
        """How many bytes of the client are still on their way to the robot."""
        return len(self._receiving)

    def hang_up(self) -> None:
        """The client leaves: its requests are carried out, but nobody hears the replies."""
        self.clear_replies()
        self._orphans = len(self._held) + len(self._receiving)

    def clear_replies(self) -> None:
        """Drop what has not reached the client."""
        self._sending.clear()
        self._due.clear()

    def clear(self) -> None:
        """Drop everything on the line, as when the plug is pulled, and count losses anew."""
        self._receiving.clear()
        self._held.clear()
        self._splitter.clear()
        self.clear_replies()
        self.lost = 0
        self._receiver_free = self._interpreter_free = self._sender_free = 0.0
        self._orphans = 0

    def _interpret(self, until: float) -> Iterator[tuple[float, bytes]]:
        # a busy interpreter leaves the bytes in the receive buffer
        while self._held and self._interpreter_free <= until:
            arrival, byte = self._held.popleft()
            orphan = self._take_orphan()
            line = self._splitter.push(byte)
            if line is not None:
                start = max(arrival, self._interpreter_free)
                self._interpreter_free = start + self._busy
                self._unheard = orphan
                yield start, line

    def _take_orphan(self) -> bool:
        """Count a byte off; returns whether it is of a client that has left."""
        orphan = self._orphans > 0
        self._orphans -= orphan
        return orphan
