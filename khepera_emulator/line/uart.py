"""The serial line in time: when a byte has arrived, and when a byte of the answer leaves.

All times are seconds on the robot's clock. A byte takes the bit times of its character, in either
direction; a request is carried out when its last byte has arrived, one after the other. Without a
rate (`baud=None`) the line takes no time. How a kind of robots speaks is its `dialect`.

Every time is a multiple of `GRID`, a power of two: sums and differences of such numbers are
exact for 97 days, so that what happens after a moment does not depend on when that moment was.
"""

from collections.abc import Iterable, Iterator
from typing import Any

from khepera_emulator.line import coding as line_coding
from khepera_emulator.line.clock import GRID as GRID
from khepera_emulator.line.clock import on_grid as on_grid
from khepera_emulator.line.coding import LineFormat
from khepera_emulator.line.dialect import KHEPERA, Dialect
from khepera_emulator.line.fault import Direction
from khepera_emulator.line.faults import Faults, Timed
from khepera_emulator.line.timed_bytes import TimedBytes

Due = tuple[float, Any]
"""A request as the robot's dialect has it, and when it is carried out."""


class Uart:
    """Both directions of the robot's serial line.

    Args:
        baud: rate in bits a second, or None for a line that takes no time.
        faults: what goes wrong on the line.
        dialect: the robot's end of it.

    Attributes:
        dialect: the robot's end.
        lost: bytes of the client that were dropped because the robot's buffer was full.
        unsent: bytes of replies that were dropped because the line had no room for them.
        faults: what goes wrong on the line.
        each: seconds that a byte takes; 0 on a line that takes no time.
        busy: seconds from the end of a request to its reply.
        receiver_free, interpreter_free, sender_free: when each is done with what it has so far.
    """

    def __init__(
        self, baud: int | None, faults: Faults | None = None, dialect: Dialect = KHEPERA
    ) -> None:
        self.dialect = dialect
        self.lost = self.unsent = 0
        self.faults = faults or Faults()
        self._faulty = bool(self.faults)
        self._client: LineFormat | None = None
        self.receiver_free = self.interpreter_free = self.sender_free = 0.0
        self._orphans = 0
        self._unheard = False
        self._splitter = dialect.splitter()
        self._receiving = TimedBytes()
        self._held = bytearray()
        self._sending = TimedBytes()
        self.baud = baud

    def note_faults(self) -> None:
        """Take note that faults were switched on or off."""
        self._faulty = bool(self.faults)
        self._plain = not self._faulty and not self._garbled

    @property
    def baud(self) -> int | None:
        """Rate in bits a second, or None for a line that takes no time.

        Setting it is setting the robot's jumpers: it holds until `use_rate` wants another one, and
        again from the next power-on.
        """
        return self._baud

    @baud.setter
    def baud(self, rate: int | None) -> None:
        self._jumpers = rate
        self._set_rate(rate)

    def use_rate(self, rate: int | None) -> None:
        """Take the rate that a request wants, or that of the jumpers again, with None.

        A line that takes no time goes on taking none.
        """
        self._set_rate(rate if rate and self._jumpers else self._jumpers)

    def _set_rate(self, rate: int | None) -> None:
        self._baud = rate
        self._format = LineFormat(rate, stop=self.dialect.stop) if rate else None
        self.each = self.dialect.character(rate) if rate else 0.0
        self.busy = self.dialect.busy if rate else 0.0
        self._compare()

    @property
    def client(self) -> LineFormat | None:
        """Settings of the client's end; None if they are the robot's.

        With others both ends read garbage.
        """
        return self._client

    @client.setter
    def client(self, settings: LineFormat | None) -> None:
        self._client = settings
        self._compare()

    def _compare(self) -> None:
        ends = self._format, self._client
        self._garbled = bool(ends[0] and ends[1] and not ends[1].matches(ends[0]))
        self._plain = not self._faulty and not self._garbled

    def receive(self, data: bytes, now: float) -> None:
        """Put bytes of the client on the line now; they arrive one after the other."""
        start = max(self.receiver_free, now)
        if self._plain:
            self.receiver_free = self._receiving.add(data, start, self.each)
            return
        items, self.receiver_free = self._pass(Direction.REQUEST, data, start)
        self._receiving.add_each(items)

    def requests(self, until: float) -> Iterable[Due]:
        """Return requests that the robot carries out by a time, with the times of their execution.

        A fault that resets the robot comes as the request to start again.
        """
        if self._faulty:
            return self._disturbed(until)
        if not self._held:
            data = self._receiving.data
            if not data:
                return ()  # a silent line, as it is most of the time
            size = self._splitter.end(data, len(data))
            alone = self._receiving.take_whole(size, self.interpreter_free, until)
            if alone:
                line = self._interpret(*alone)
                return ((alone[0], line),) if line is not None else ()
        return self._carried_out(until)

    def _disturbed(self, until: float) -> Iterator[Due]:
        while (moment := self.faults.next_moment()) is not None and moment <= until:
            yield from self._carried_out(moment)
            yield from self._happen()
        yield from self._carried_out(until)

    def _carried_out(self, until: float) -> Iterator[Due]:
        receiving, held = self._receiving, self._held
        while receiving.data or held:
            free = self.interpreter_free
            if receiving.data:
                # what arrives while the interpreter is busy waits in the receive buffer
                self._hold(receiving.arrived(min(until, free - GRID)))
            if held and free <= until:
                start, count = free, self._splitter.end(held, len(held)) or len(held)
                data = bytes(held[:count])
                del held[:count]
            elif count := 0 if held else receiving.arrived(until):
                # an idle interpreter takes a byte at once
                count = self._splitter.end(receiving.data, count) or count
                start, data = receiving.due(count), receiving.take(count)
            else:
                return
            line = self._interpret(start, data)
            if line is not None:
                yield start, line

    def _hold(self, count: int) -> None:
        """So many more bytes arrive in the receive buffer."""
        if count:
            data = self._receiving.take(count)
            fitting = data[: self.dialect.receive_limit - len(self._held)]
            self._held += fitting
            self.lost += count - len(fitting)
            self._count_orphans(count - len(fitting))

    def _interpret(self, start: float, data: bytes) -> Any:
        """Let the interpreter take bytes in; return the request that the last one completes."""
        orphan = self._count_orphans(len(data))
        line = self._splitter.take(data)
        if line is None:
            return None
        self.interpreter_free = start + self.busy
        self._unheard = orphan
        if self._faulty and self.faults.on_request(start):
            self._reset(start)
            return self.dialect.restart
        return line

    def _count_orphans(self, count: int) -> bool:
        """Count bytes off; returns whether the last one is of a client that has left."""
        orphans = self._orphans
        self._orphans = max(0, orphans - count)
        return orphans >= count

    def send(self, data: bytes, executed: float) -> None:
        """Queue a reply to the latest request, executed at a time, behind earlier ones."""
        if self._unheard:
            return
        if self._faulty:
            data = self.faults.on_reply(executed, data)
        self._say(data, executed + self.busy)

    def send_later(self, data: bytes, executed: float, seconds: float) -> None:
        """Queue more of the latest reply, which the interpreter is busy with for so long.

        It comes to no other request meanwhile. On a line that takes no time this takes none.
        """
        self.interpreter_free = executed + (on_grid(seconds) if self._baud else 0.0)
        if not self._unheard:
            self._say(data, self.interpreter_free)

    def sent(self, now: float, limit: int | None = None) -> bytes:
        """Take the bytes, at most `limit`, that have reached the client by now."""
        count = self._sending.arrived(now)
        return self._sending.take(count if limit is None else min(count, max(limit, 0)))

    def arrived(self, now: float) -> int:
        """Count the bytes that have reached the client by now and were not taken yet."""
        return self._sending.arrived(now)

    def waiting(self, count: int) -> bytes:
        """Return the first `count` of the queued bytes, which stay where they are."""
        return bytes(self._sending.data[:count])

    def take(self, count: int) -> None:
        """Remove the first `count` of the queued bytes: the client has them."""
        self._sending.take(count)

    def queued(self) -> int:
        """Count the bytes of replies that have reached the client or are on their way to it."""
        return len(self._sending.data)

    def find(self, text: bytes) -> int:
        """Find where a text begins among the queued bytes; -1 if it is not there."""
        return self._sending.data.find(text)

    def due(self, count: int) -> float:
        """Return when the first `count` queued bytes have reached the client."""
        return self._sending.due(count)

    def next_request(self) -> float | None:
        """Return when the robot may next carry out a request or a fault happens; None: never."""
        request = None
        if self._held:
            request = self.interpreter_free
        elif self._receiving.data:
            data = self._receiving.data
            size = self._splitter.end(data, len(data))
            request = self._receiving.due(size) if size else None
        moment = self.faults.next_moment() if self._faulty else None
        if request is None or moment is None:
            return moment if request is None else request
        return min(request, moment)

    def received_by(self) -> float:
        """Return when the last byte that the client has written arrives at the robot."""
        return self.receiver_free

    def arriving(self) -> int:
        """Count the bytes of the client that are still on their way to the robot."""
        return len(self._receiving.data)

    def room(self, now: float, most: int) -> int:
        """Count the bytes that may follow those that are arriving, up to a limit of these."""
        # garbled or lost bytes take their time on the line, too
        if self.receiver_free - now > most * self.each:
            return 0
        return max(0, most - len(self._receiving.data))

    @property
    def idle(self) -> bool:
        """True if nothing is on its way in either direction; half a request may be held."""
        return not (self._receiving.data or self._held or self._sending.data)

    def silent(self, now: float) -> bool:
        """Tell whether nothing is held or on its way, and whatever follows is plain exchanges."""
        free = max(self.receiver_free, self.interpreter_free, self.sender_free) <= now
        empty = getattr(self._splitter, "empty", False)
        return self._plain and free and self.idle and not self._orphans and empty

    def silent_since(self, receiver: float, interpreter: float, sender: float) -> None:
        """Take note of exchanges that are over; see the attributes of the class."""
        self.receiver_free, self.interpreter_free, self.sender_free = receiver, interpreter, sender
        self._unheard = False

    def hang_up(self) -> None:
        """Let the client leave: its requests are carried out, but nobody hears the replies."""
        self.clear_replies()
        self._orphans = len(self._held) + len(self._receiving.data)

    def clear_replies(self) -> None:
        """Drop what has not reached the client."""
        self._sending.clear()

    def clear(self) -> None:
        """Drop everything on the line, which is as after power-on, and count losses anew."""
        self.use_rate(None)
        self._unheard = False
        self._receiving.clear()
        self._held.clear()
        self._splitter.clear()
        self.clear_replies()
        self.lost = self.unsent = 0
        self.receiver_free = self.interpreter_free = self.sender_free = 0.0
        self._orphans = 0

    def _say(self, data: bytes, start: float) -> None:
        """Queue bytes for the client, to begin at a time if the line is free."""
        if len(self._sending.data) + len(data) > self.dialect.send_limit:
            self.unsent += len(data)
            return
        start = max(self.sender_free, start)
        if self._plain:
            self.sender_free = self._sending.add(data, start, self.each)
            return
        items, self.sender_free = self._pass(Direction.REPLY, data, start)
        self._sending.add_each(items)

    def _pass(self, direction: Direction, data: bytes, start: float) -> tuple[list[Timed], float]:
        """Return what arrives of bytes and when, and when the line is free again."""
        each = self.each
        if self._garbled:
            items, free = self._garble(direction, data, start)
        else:
            items = [(start + each * count, byte) for count, byte in enumerate(data, 1)]
            free = start + each * len(data)
        if not self._faulty:
            return items, free
        items, late = self.faults.on_bytes(direction, items, each)
        return items, free + late

    def _garble(self, direction: Direction, data: bytes, start: float) -> tuple[list[Timed], float]:
        """Return bytes as an end with other settings reads them."""
        assert self._format is not None
        assert self.client is not None
        ends = (self.client, self._format)
        sender, receiver = ends if direction is Direction.REQUEST else reversed(ends)
        each = on_grid(receiver.frame / receiver.baud)
        heard = line_coding.receive(data, sender, receiver)
        items = [(start + on_grid(character.start) + each, character.byte) for character in heard]
        return items, start + on_grid(len(data) * sender.frame / sender.baud)

    def _happen(self) -> Iterator[Due]:
        """Return the next fault that has a time of its own."""
        when, said, starts_again = self.faults.take_moment()
        if said:
            self._say(said, when)
        if starts_again:
            self._reset(when)
            self._unheard = False
            yield when, self.dialect.restart

    def _reset(self, when: float) -> None:
        """Start the robot again: what it holds and what it has not said yet is lost."""
        self._count_orphans(len(self._held))
        self._held.clear()
        self._splitter.clear()
        self._sending.keep(self.arrived(when))
        self.interpreter_free = when + self.busy
        self.sender_free = min(self.sender_free, when)
