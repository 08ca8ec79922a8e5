"""The robot's serial line as a pseudo-terminal.

Clients open and close it as they like, several at a time if they want. What the robot says while
nobody listens is lost, and what nobody reads is dropped and counted, as on a serial port.

The kernel tells when the last client has left: then nobody has the terminal open, and the master
side hangs up. So that this neither goes unseen nor lasts, the terminal is held open here while
there is no client, and let go when one has written. A client that follows another one before
anybody has looked is known from the watch on openings and closings.
"""

import errno
import fcntl
import os
import select
import sys
import termios
import tty
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Final

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line_coding import LineFormat
from khepera_emulator.ports.watch import CLOSED_READABLE, OPENED, WRITTEN, Watch

FIRST_RATE = 9600
"""Bits a second that the line shows until a client sets another rate: a Khepera's mode 1."""

_RATES: Final = {
    value: int(name[1:])
    for name, value in vars(termios).items()
    if name[0] == "B" and name[1:].isdecimal() and name != "B0"
}
_ALL = 1 << 16
_LOOKS = 4
"""How often to look again for a client that goes on writing."""

_TELLING = 0.02
"""Seconds to wait for the event of a newcomer's writing, when bytes of two clients may be mixed."""

_CFLAG, _ISPEED, _OSPEED = 2, 4, 5
_TCGETS2: Final = 0x802C542A
"""Linux's request for settings with the rate as a number, on x86, ARM and RISC-V."""

_TERMIOS2_SIZE: Final = 44


@dataclass(slots=True)
class _Change:
    """One client left and another came before anybody looked.

    Attributes:
        left_bytes: the one that left may have written something that was not taken yet.
        new_bytes: the one that came has written.
    """

    left_bytes: bool
    new_bytes: bool = False

    def divide(self, data: bytes) -> int:
        """Where the newcomer's bytes begin; nothing in them tells."""
        if not self.left_bytes:
            return 0
        if not self.new_bytes:
            return len(data)
        # a newcomer has hardly sent more than one request within a moment
        return data.rstrip(b"\r\n").rfind(b"\n") + 1


class PtyPort:
    """Master side of a pseudo-terminal.

    Attributes:
        path: the terminal that clients open.
        dropped: bytes to clients that did not fit because they do not read.

    Raises:
        EmulatorError: the system gives none.
    """

    def __init__(self) -> None:
        with ExitStack() as stack:
            try:
                self._master, slave = os.openpty()
            except OSError as error:
                raise EmulatorError(f"no pseudo-terminal to be had: {error.strerror}") from None
            stack.callback(os.close, self._master)
            stack.callback(os.close, slave)
            self.path = os.ttyname(slave)
            self.dropped = 0
            self._clients = 0
            self._closing = False
            self._kept_back = False
            self._hang_ups = select.poll()
            self._hang_ups.register(self._master, 0)
            os.set_blocking(self._master, False)
            settings = termios.tcgetattr(slave)
            settings[_ISPEED] = settings[_OSPEED] = termios.B9600
            termios.tcsetattr(slave, termios.TCSANOW, settings)
            self._watch = Watch(self.path)
            stack.callback(self._watch.close)
            self._slave: int | None = None
            self._hold()
            self._make_raw()
            stack.pop_all()
        os.close(slave)
        self._watch.take()

    def close(self) -> None:
        """Hang up: clients get an error from now on."""
        self._watch.close()
        if self._slave is not None:
            os.close(self._slave)
        os.close(self._master)

    @property
    def url(self) -> str:
        """What a pySerial client opens: the terminal's path."""
        return self.path

    def descriptors(self, *, room: bool) -> list[int]:
        """Descriptors that become readable when clients come, write or leave."""
        return [self._watch.fileno(), *([self._master] if room else [])]

    def settings(self) -> LineFormat | None:
        """What the client has set; None for a rate of zero.

        A pseudo-terminal has eight data bits and no parity, whatever its clients ask for.
        """
        settings = termios.tcgetattr(self._master)
        rate = _RATES.get(settings[_OSPEED]) or self._odd_rate()
        stop = 2 if settings[_CFLAG] & termios.CSTOPB else 1
        return LineFormat(rate, stop=stop) if rate else None

    def _odd_rate(self) -> int | None:
        """A rate without a name of its own, where this system tells."""
        termios2 = bytearray(_TERMIOS2_SIZE)
        try:
            fcntl.ioctl(self._master, _TCGETS2, termios2)
        except OSError:
            return None
        return int.from_bytes(termios2[-4:], sys.byteorder) or None

    def receive(self, limit: int) -> list[bytes]:
        """What clients have done since the last call, in order.

        Args:
            limit: bytes to take at most; the rest stays with the client.

        Returns:
            Bytes that were written; an empty chunk says that the client has left.

        Raises:
            EmulatorError: a client has barred everybody else from the terminal for ever.
        """
        kept_back = self._kept_back
        try:
            data, events = self._look(limit)
        except EOFError:
            self._forget_client()
            return [b""]
        change = self._count(events)
        if data:
            self._let_go()
        if self._slave is None and self._clients == 0:
            if self._is_deserted():
                data += self._read_rest()
                self._forget_client()
                return [data, b""] if data else [b""]
            # either another one has come just now, or two have come as one before
            change = change or self._count(self._watch.take())
            self._clients = max(1, self._clients)
        if change:
            change.left_bytes = change.left_bytes or kept_back
            return self._change_client(change, data)
        if data:
            return [data]
        if events and not self._clients:
            self._make_raw()  # somebody has looked in, and may have set something
        return []

    def changed(self) -> bool:
        """Whether clients have come or left since the last look."""
        return any(event != WRITTEN for event in self._watch.peek())

    def write(self, data: bytes) -> None:
        """Hand bytes to the client; never waits. What nobody listens to is lost, not kept."""
        if self._slave is not None and not self._clients:
            return
        try:
            taken = os.write(self._master, data)
        except BlockingIOError:
            taken = 0
        self.dropped += len(data) - taken

    def _read(self, limit: int) -> bytes:
        """What was written, up to a limit.

        Raises:
            EOFError: nothing, and nobody has the terminal open.
        """
        try:
            return os.read(self._master, limit)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno == errno.EIO:
                raise EOFError from None
            raise

    def _look(self, limit: int) -> tuple[bytes, list[int]]:
        """What was written, and the events up to it; neither is ahead of the other.

        Raises:
            EOFError: nothing, and nobody has the terminal open.
        """
        data = self._read(limit) if limit > 0 else b""
        # only now: whoever wrote this had opened the terminal before
        events = news = self._watch.take()
        for _ in range(_LOOKS):
            if WRITTEN not in news or len(data) >= limit:
                break
            # it may have been written since: otherwise a later client would pass for its writer
            with suppress(EOFError):
                data += self._read(limit - len(data))
            news = self._watch.take()
            events = events + news
        self._kept_back = len(data) >= limit or WRITTEN in news
        return data, events

    def _count(self, events: list[int]) -> _Change | None:
        """Keep count of clients; tells if one has followed another one.

        Events that came as one make the count wrong, until the last client leaves.
        """
        change = None
        before = self._slave is None
        written = False
        for event in events:
            if event == OPENED:
                if before and self._clients == 0:
                    change = _Change(left_bytes=written)
                    written = False
                self._clients += 1
            elif event == WRITTEN:
                written = True
            elif event == CLOSED_READABLE and self._closing:
                self._closing = False  # the own one
            else:
                before = True
                self._clients = max(0, self._clients - 1)
        if change:
            change.new_bytes = written
        return change

    def _change_client(self, change: _Change, data: bytes) -> list[bytes]:
        data += self._read_rest()
        news = self._watch.take()
        if data and not change.new_bytes and not news:
            # bytes are there a little before the event that tells of them
            select.select([self._watch.fileno()], (), (), _TELLING)
            news = self._watch.take()
        if WRITTEN in news:  # it has written since, and that may be among the rest
            change.new_bytes = True
            data += self._read_rest()
        with suppress(EmulatorError):  # the new client keeps us out: it may find stale bytes
            self._hold()
        self._let_go()
        self._clients = 1
        cut = change.divide(data)
        return [*filter(None, (data[:cut],)), b"", *filter(None, (data[cut:],))]

    def _forget_client(self) -> None:
        self._hold()
        self._make_raw()

    def _is_deserted(self) -> bool:
        """Whether the clients, of whom one has written, have left."""
        return bool(self._hang_ups.poll(0))

    def _read_rest(self) -> bytes:
        data = b""
        with suppress(EOFError):
            while len(data) < _ALL and (more := self._read(_ALL)):
                data += more
        return data

    def _hold(self) -> None:
        """Open the terminal, so that there is no hang-up, and empty it."""
        self._clients = 0
        if self._slave is None:
            try:
                self._slave = os.open(self.path, os.O_RDONLY | os.O_NOCTTY)
            except OSError as error:
                raise EmulatorError(
                    f"a client has taken {self.path} for itself for ever (TIOCEXCL):"
                    f" {error.strerror}; start the emulator again"
                ) from None
        termios.tcflush(self._slave, termios.TCIFLUSH)
        self._watch.take()

    def _let_go(self) -> None:
        """Close the terminal, because a client has it open: its leaving shall be noticed."""
        if self._slave is None:
            return
        # an exclusive terminal stays so when its client has left, and we could not come back
        fcntl.ioctl(self._slave, termios.TIOCNXCL)
        os.close(self._slave)
        self._slave = None
        self._closing = True

    def _make_raw(self) -> None:
        """Undo what a client has set, but for its rate."""
        if self._slave is not None:
            fcntl.ioctl(self._slave, termios.TIOCNXCL)
            tty.setraw(self._slave, termios.TCSANOW)
