"""The serial line in time: when a byte has arrived, and when a byte of the answer leaves.

All times are seconds on the robot's clock. A byte takes 11 bit times, in either direction; a
request is carried out when its last byte has arrived, one after the other. Without a rate
(`baud=None`) the line takes no time.

Every time is a multiple of `GRID`, a power of two: sums and differences of such numbers are
exact for 97 days, so that what happens after a moment does not depend on when that moment was.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from typing import Final

from khepera_emulator import line_coding
from khepera_emulator.clock import GRID as GRID
from khepera_emulator.clock import on_grid as on_grid
from khepera_emulator.faults import Direction, Faults, Timed
from khepera_emulator.line_coding import LineFormat
from protocol.framing import RequestSplitter
from protocol.units import wire_time

RECEIVE_LIMIT: Final = 256
"""Bytes that the robot holds before its interpreter takes them; more are lost."""

SEND_LIMIT: Final = 4096
"""Bytes of replies that wait for the line; a whole reply that does not fit is lost."""

_LINE_END = b"\r\n"
_RESTART = b"restart"
"""The ROM's tool that starts the robot again: what its reset button does."""


INTERPRETER_TIME: Final = on_grid(0.0015)
"""Seconds between the end of a request and the first bit of its reply (a choice)."""


class Uart:
    """Both directions of the robot's serial line.

    Args:
        baud: rate in bits a second, or None for a line that takes no time.
        faults: what goes wrong on the line.

    Attributes:
        lost: bytes dropped because a queue was full.
        client: settings of the client's end; None if they are the robot's. With others both
            ends read garbage.
        faults: what goes wrong on the line.
    """

    def __init__(self, baud: int | None, faults: Faults | None = None) -> None:
        self.lost = 0
        self.client: LineFormat | None = None
        self.faults = faults or Faults()
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
        self._format = LineFormat(rate, stop=2) if rate else None
        self._each: float = on_grid(wire_time(1, rate)) if rate else 0.0
        self._busy = INTERPRETER_TIME if rate else 0.0

    def receive(self, data: bytes, now: float) -> None:
        """Bytes that the client puts on the line now; they arrive one after the other."""
        start = max(self._receiver_free, now)
        if self._is_plain():
            each = self._each
            for byte in data:
                start += each
                self._receiving.append((start, byte))
            self._receiver_free = start
            return
        items, self._receiver_free = self._pass(Direction.REQUEST, data, start)
        self._receiving.extend(items)

    def requests(self, until: float) -> Iterable[tuple[float, bytes]]:
        """Requests that the robot carries out by a time, with the times of their execution.

        A fault that resets the robot comes as the request to start again.
        """
        if self.faults:
            return self._disturbed(until)
        if not (self._receiving or self._held):
            return ()  # a silent line, as it is most of the time
        return self._carried_out(until)

    def _disturbed(self, until: float) -> Iterator[tuple[float, bytes]]:
        while (moment := self.faults.next_moment()) is not None and moment <= until:
            yield from self._carried_out(moment)
            yield from self._happen()
        yield from self._carried_out(until)

    def _carried_out(self, until: float) -> Iterator[tuple[float, bytes]]:
        receiving, held = self._receiving, self._held
        while receiving and receiving[0][0] <= until:
            arrival, byte = receiving.popleft()
            if held:
                yield from self._interpret(arrival)
            if not held and self._interpreter_free <= arrival:
                # an idle interpreter takes it at once
                line = self._take(arrival, byte)
                if line is not None:
                    yield arrival, line
            elif len(held) < RECEIVE_LIMIT:
                held.append((arrival, byte))
            else:
                self.lost += 1
                self._take_orphan()
        if held:
            yield from self._interpret(until)

    def send(self, data: bytes, executed: float) -> None:
        """A reply to the latest request, executed at a time: queue it behind earlier ones."""
        if self._unheard:
            return
        self._say(self.faults.on_reply(executed, data), executed + self._busy)

    def sent(self, now: float, limit: int | None = None) -> bytes:
        """Take the bytes, at most `limit`, that have reached the client by now."""
        count = self.arrived(now)
        if limit is not None and limit < count:
            count = max(limit, 0)
        out = bytes(self._sending[:count])
        if count == len(self._due):
            self._sending.clear()
            self._due.clear()
        else:
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
        """When the next byte arrives, is interpreted or a fault happens; None: a silent line."""
        times = [self._interpreter_free] if self._held else []
        if (moment := self.faults.next_moment()) is not None:
            times.append(moment)
        if self._receiving:
            times.append(self._receiving[0][0])
        if self._due:
            times.append(self._due[0])
        return min(times, default=None)

    def next_request(self) -> float | None:
        """When the robot may next carry out a request or a fault happens; None: nothing is due."""
        if self._held:
            request: float | None = self._interpreter_free
        else:
            request = next((when for when, byte in self._receiving if byte in _LINE_END), None)
        moment = self.faults.next_moment()
        if request is None or moment is None:
            return moment if request is None else request
        return min(request, moment)

    def received_by(self) -> float:
        """When the last byte that the client has written arrives at the robot."""
        return self._receiver_free

    def wire_time(self, count: int) -> float:
        """Seconds that a number of bytes takes on the line."""
        return count * self._each

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

    def _say(self, data: bytes, start: float) -> None:
        """Queue bytes for the client, to begin at a time if the line is free."""
        if len(self._sending) + len(data) > SEND_LIMIT:
            self.lost += len(data)
            return
        due = max(self._sender_free, start)
        if self._is_plain():
            each = self._each
            self._due.extend([due + each * count for count in range(1, len(data) + 1)])
            self._sending += data
            self._sender_free = due + each * len(data)
            return
        items, self._sender_free = self._pass(Direction.REPLY, data, due)
        self._due.extend(when for when, _ in items)
        self._sending += bytes(byte for _, byte in items)

    def _is_plain(self) -> bool:
        """Whether bytes arrive as they were sent."""
        return not self.faults and not self._is_garbled()

    def _is_garbled(self) -> bool:
        return bool(self._format and self.client and not self.client.matches(self._format))

    def _pass(self, direction: Direction, data: bytes, start: float) -> tuple[list[Timed], float]:
        """What arrives of bytes and when, and when the line is free again."""
        each = self._each
        if self._is_garbled():
            items, free = self._garble(direction, data, start)
        else:
            items = [(start + each * count, byte) for count, byte in enumerate(data, 1)]
            free = start + each * len(data)
        if not self.faults:
            return items, free
        items, late = self.faults.on_bytes(direction, items, each)
        return items, free + late

    def _garble(self, direction: Direction, data: bytes, start: float) -> tuple[list[Timed], float]:
        """Bytes as an end with other settings reads them."""
        assert self._format is not None
        assert self.client is not None
        ends = (self.client, self._format)
        sender, receiver = ends if direction is Direction.REQUEST else reversed(ends)
        each = on_grid(receiver.frame / receiver.baud)
        heard = line_coding.receive(data, sender, receiver)
        items = [(start + on_grid(character.start) + each, character.byte) for character in heard]
        return items, start + on_grid(len(data) * sender.frame / sender.baud)

    def _happen(self) -> Iterator[tuple[float, bytes]]:
        """The next fault that has a time of its own."""
        when, kind, text = self.faults.take_moment()
        if kind == "stray":
            self._say(text, when)
        elif kind == "reset":
            self._reset(when)
            self._unheard = False
            yield when, _RESTART

    def _reset(self, when: float) -> None:
        """The robot starts again: what it holds and what it has not said yet is lost."""
        for _ in self._held:
            self._take_orphan()
        self._held.clear()
        self._splitter.clear()
        said = self.arrived(when)
        del self._sending[said:]
        while len(self._due) > said:
            self._due.pop()
        self._interpreter_free = when + self._busy
        self._sender_free = min(self._sender_free, when)

    def _interpret(self, until: float) -> Iterator[tuple[float, bytes]]:
        # a busy interpreter leaves the bytes in the receive buffer
        while self._held and self._interpreter_free <= until:
            arrival, byte = self._held.popleft()
            start = max(arrival, self._interpreter_free)
            line = self._take(start, byte)
            if line is not None:
                yield start, line

    def _take(self, start: float, byte: int) -> bytes | None:
        """The interpreter takes a byte in; returns the request that it completes."""
        orphan = self._take_orphan()
        line = self._splitter.push(byte)
        if line is not None:
            self._interpreter_free = start + self._busy
            self._unheard = orphan
            if self.faults and self.faults.on_request(start):
                self._reset(start)
                return _RESTART
        return line

    def _take_orphan(self) -> bool:
        """Count a byte off; returns whether it is of a client that has left."""
        if not self._orphans:
            return False
        self._orphans -= 1
        return True
