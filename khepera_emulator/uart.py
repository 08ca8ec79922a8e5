"""The serial line in time: when a byte has arrived, and when a byte of the answer leaves.

All times are seconds on the robot's clock. A byte takes 11 bit times, in either direction; a
request is carried out when its last byte has arrived, one after the other. Without a rate
(`baud=None`) the line takes no time.
"""

from collections import deque
from collections.abc import Iterator

from protocol.framing import RequestSplitter
from protocol.units import wire_time

INTERPRETER_TIME = 0.0015
"""Seconds between the end of a request and the first bit of its reply (a choice)."""

RECEIVE_LIMIT = 256
"""Bytes that the robot holds before its interpreter takes them; more are lost."""

SEND_LIMIT = 4096
"""Bytes of replies that wait for the line; a whole reply that does not fit is lost."""


class Uart:
    """Both directions of the robot's serial line.

    Attributes:
        baud: rate in bits a second, or None for a line that takes no time.
        lost: bytes dropped because a queue was full.
    """

    def __init__(self, baud: int | None) -> None:
        self.baud = baud
        self.lost = 0
        self._splitter = RequestSplitter()
        self._receiving: deque[tuple[float, int]] = deque()
        self._sending: deque[tuple[float, int]] = deque()
        self._receiver_free = 0.0
        self._interpreter_free = 0.0
        self._sender_free = 0.0

    def receive(self, data: bytes, now: float) -> None:
        """Bytes that the client puts on the line now; they arrive one after the other."""
        each = self._byte_time()
        for byte in data:
            self._receiver_free = max(self._receiver_free, now) + each
            self._receiving.append((self._receiver_free, byte))

    def requests(self, until: float) -> Iterator[tuple[float, bytes]]:
        """Requests whose last byte has arrived by a time, with the time of their execution."""
        while self._receiving and self._receiving[0][0] <= until:
            arrival, byte = self._receiving.popleft()
            line = self._splitter.push(byte)
            if line is not None:
                start = max(arrival, self._interpreter_free)
                self._interpreter_free = start + (INTERPRETER_TIME if self.baud else 0.0)
                yield start, line

    def send(self, data: bytes, executed: float) -> None:
        """A reply to a request that was executed at a time: queue it behind earlier ones."""
        if len(self._sending) + len(data) > SEND_LIMIT:
            self.lost += len(data)
            return
        each = self._byte_time()
        start = executed + (INTERPRETER_TIME if self.baud else 0.0)
        for byte in data:
            self._sender_free = max(self._sender_free, start) + each
            self._sending.append((self._sender_free, byte))

    def sent(self, now: float, limit: int | None = None) -> bytes:
        """Take the bytes, at most `limit`, that have reached the client by now."""
        out = bytearray()
        while self._sending and self._sending[0][0] <= now and (limit is None or len(out) < limit):
            out.append(self._sending.popleft()[1])
        return bytes(out)

    def arrived(self, now: float) -> int:
        """How many bytes have reached the client by now and were not taken yet."""
        return sum(1 for when, _ in self._sending if when <= now)

    def next_event(self) -> float | None:
        """When the next byte arrives at either end; None for a silent line."""
        times = [queue[0][0] for queue in (self._receiving, self._sending) if queue]
        return min(times, default=None)

    def received_by(self) -> float:
        """When the last byte that the client has written arrives at the robot."""
        return self._receiver_free

    def clear_replies(self) -> None:
        """Drop what has not reached the client."""
        self._sending.clear()

    def clear(self) -> None:
        """Drop everything on the line, as when the plug is pulled."""
        self._receiving.clear()
        self._sending.clear()
        self._splitter.clear()

    def _byte_time(self) -> float:
        return wire_time(1, self.baud) if self.baud else 0.0
