"""A pseudo-terminal from its master side: bytes, settings, and who opens and closes it.

The kernel tells when nobody has the terminal open: then the master side hangs up. Openings and
closings between two looks are known from a watch. A terminal that is held open here never hangs
up.
"""

import errno
import fcntl
import os
import select
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Final

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.coding import LineFormat
from khepera_emulator.ports.inotify import CLOSED_READABLE, COMINGS, OPENED, READ, Watch

_RATES: Final = {
    value: int(name[1:])
    for name, value in vars(termios).items()
    if name[0] == "B" and name[1:].isdecimal() and name != "B0"
}
_ALL: Final = 1 << 17
"""Bytes: more than the kernel keeps for one direction."""

UNREAD_LIMIT: Final = 4095
"""Bytes that a client may leave unread: what a terminal's input queue holds."""

_CFLAG, _ISPEED, _OSPEED = 2, 4, 5
_TCGETS2: Final = 0x802C542A
"""Linux's request for settings with the rate as a number, on x86, ARM and RISC-V."""

_TCSETS2: Final = 0x402C542B
_TERMIOS2_SIZE: Final = 44


class TerminalLostError(EmulatorError):
    """A terminal that a client has left in a state in which nobody can use it."""


class Terminal:
    """A raw terminal at 9600, held open.

    Attributes:
        path: what clients open.
        held: whether it is held open here.

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
            os.set_blocking(self._master, False)
            tty.setraw(slave, termios.TCSANOW)
            settings = termios.tcgetattr(slave)
            settings[_ISPEED] = settings[_OSPEED] = termios.B9600
            termios.tcsetattr(slave, termios.TCSANOW, settings)
            self.path = os.ttyname(slave)
            self._slave: int | None = None
            self.held = False
            self._watch = Watch(self.path)
            stack.callback(self._watch.close)
            self._early: tuple[int, ...] = ()
            self._unread = 0
            self._bytes = select.poll()
            self._bytes.register(self._master, select.POLLIN)
            self._news = select.poll()
            self._news.register(self._master, 0)  # hang-ups alone
            self._news.register(self._watch.fileno(), select.POLLIN)
            self._descriptors = (self._watch.fileno(), self._master)
            self.hold()
            stack.pop_all()
        os.close(slave)
        self.events()

    def close(self) -> None:
        """Hang up: clients get an error from now on."""
        self._watch.close()
        if self._slave is not None:
            os.close(self._slave)
        os.close(self._master)

    def descriptors(self, *, room: bool) -> tuple[int, ...]:
        """Return descriptors that become readable when clients come or leave, and when they write.

        Once the terminal is let go its master side tells all; the watch, which every reading and
        writing wakes, can wait until somebody asks for events.
        """
        if not room:
            return self._descriptors[:1]
        return self._descriptors if self.held else self._descriptors[1:]

    def settings(self) -> LineFormat | None:
        """Return what a client has set; None for a rate of zero."""
        settings = termios.tcgetattr(self._master)
        rate = _RATES.get(settings[_OSPEED]) or self._odd_rate()
        stop = 2 if settings[_CFLAG] & termios.CSTOPB else 1
        return LineFormat(rate, stop=stop) if rate else None

    def copy_settings(self, other: "Terminal") -> None:
        """Take over what clients have set on another terminal, if the system tells all of it."""
        settings = other._termios2()
        if settings:
            with suppress(OSError):
                fcntl.ioctl(self._master, _TCSETS2, settings)

    def _odd_rate(self) -> int | None:
        """Return a rate without a name of its own, where this system tells."""
        return int.from_bytes(self._termios2()[-4:], sys.byteorder) or None

    def _termios2(self) -> bytearray:
        """Return the settings as the kernel keeps them; empty on a system that does not tell."""
        settings = bytearray(_TERMIOS2_SIZE)
        try:
            fcntl.ioctl(self._master, _TCGETS2, settings)
        except OSError:
            return bytearray()
        return settings

    def read(self, limit: int) -> bytes:
        """Return what was written, up to a limit.

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

    def read_all(self) -> bytes:
        """Return all that was written, but for a client that writes faster than it can be read."""
        data = b""
        with suppress(EOFError):
            while len(data) < _ALL and (more := self.read(_ALL)):
                data += more
        return data

    def readable(self) -> bool:
        """Tell whether there is something to read, or nobody left to write it."""
        return bool(self._bytes.poll(0))

    def write(self, data: bytes) -> int:
        """Hand bytes to those who read; returns how many there was room for.

        What nobody reads is kept up to a limit, although the kernel would keep more: clients flush
        their input when they come, and that does not reach the rest.
        """
        if READ in self._early:
            self._unread = 0
        if self._unread + len(data) > UNREAD_LIMIT:
            return 0
        try:
            taken = os.write(self._master, data)
        except BlockingIOError:
            return 0
        self._unread += taken
        return taken

    def events(self) -> tuple[int, ...]:
        """Return what clients have done since the last call, as `Watch.take` tells it."""
        events = self._watch.take()
        if self._early:
            events, self._early = self._early + events, ()
        if READ in events:
            self._unread = 0
        return events

    def put_back(self, events: tuple[int, ...]) -> None:
        """Keep events that the next call of `events` shall give first."""
        self._early = events + self._early

    def wait_for_news(self, milliseconds: int) -> tuple[bool, bool]:
        """Wait for the hang-up and for events; whether there are any."""
        if self._early:
            milliseconds = 0
        happened = [descriptor for descriptor, _ in self._news.poll(milliseconds)]
        return self._master in happened, bool(self._early) or self._watch.fileno() in happened

    def changed(self) -> bool:
        """Tell whether clients have come or left since the last call of `events`."""
        happened = self._news.poll(0)
        if not happened and not self._early:
            return False
        if any(descriptor == self._master for descriptor, _ in happened):
            return True
        self._early += self._watch.take()
        return not COMINGS.isdisjoint(self._early)

    def hold(self) -> None:
        """Open the terminal, so that there is no hang-up, and put right what a client left.

        Raises:
            TerminalLostError: a client has barred everybody else from it for ever, or hung it up.
        """
        with self._usable():
            if self._slave is None:
                with self._own(OPENED):
                    self._slave = os.open(self.path, os.O_RDONLY | os.O_NOCTTY)
                self.held = True
            self._admit_all(self._slave)
            # the output that a client has stopped stays so: the next one would wait for ever
            for action in (termios.TCOOFF, termios.TCOON):  # alone the second ends no XOFF
                termios.tcflow(self._slave, action)

    def drop_unread(self) -> None:
        """Drop what clients were told and have not read; only while it is held.

        Raises:
            TerminalLostError: a client has hung it up for everybody.
        """
        if self._slave is not None:
            with self._usable():
                termios.tcflush(self._master, termios.TCOFLUSH)  # on its way to the queue
                termios.tcflush(self._slave, termios.TCIFLUSH)
            self._unread = 0

    def let_go(self) -> None:
        """Close the terminal, because a client has it open: its leaving shall be noticed."""
        if self._slave is not None:
            with suppress(OSError):
                self._admit_all(self._slave)
            with self._own(CLOSED_READABLE):
                os.close(self._slave)
            self._slave = None
            self.held = False

    @staticmethod
    def _admit_all(slave: int) -> None:
        """Let everybody open it, even if a client has taken it for itself.

        It would stay so when its client has left, and then we could not come back.
        """
        fcntl.ioctl(slave, termios.TIOCNXCL)

    @contextmanager
    def _usable(self) -> Iterator[None]:
        """Do something that fails only if a client has spoiled the terminal."""
        try:
            yield
        except (OSError, termios.error) as error:
            raise TerminalLostError(
                f"a client has made {self.path} unusable ({error.args[-1]}), as by TIOCEXCL"
            ) from None

    @contextmanager
    def _own(self, event: int) -> Iterator[None]:
        """Do something that is no news: its event is left out."""
        before = self._watch.take()
        try:
            yield
        finally:
            after = [*reversed(self._watch.take())]
            with suppress(ValueError):
                # the last such event: clients may have come and left before it was our turn
                after.remove(event)
            self._early += (*before, *reversed(after))
