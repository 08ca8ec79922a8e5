"""The robot's serial line as a pseudo-terminal.

Clients open and close it as they like, several at a time if they want. What the robot says while
nobody listens is lost, and what nobody reads is dropped and counted, as on a serial port. What
clients set stays set when they leave, as on a serial port.

The terminal is held open here while there is no client, and let go when one has written: so the
hang-up tells that the last one has left. A client that follows another one before anybody has
looked is known from the events of opening and closing.

A client may leave the terminal so that nobody else can open it. Then the line moves to a new one.
"""

import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Self

from khepera_protocol.text import quoted

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.coding import LineFormat
from khepera_emulator.ports.inotify import (
    CLOSED_READABLE,
    CLOSED_WRITABLE,
    COMINGS,
    OPENED,
    READ,
    WRITTEN,
)
from khepera_emulator.ports.port import PortRequest
from khepera_emulator.ports.terminal import Terminal, TerminalLostError

_log = logging.getLogger(__name__)

_CLOSED: Final = (CLOSED_READABLE, CLOSED_WRITABLE)
_LOOKS: Final = 4
"""Looks again for a client that goes on writing, at most."""

_TELLING: Final = 20
"""Milliseconds to wait for what must follow at once: for the event of a writing when its bytes
are there already, and for the hang-up when the event of the last closing is."""


@dataclass(slots=True)
class _Change:
    """One client left and another came before anybody looked.

    Attributes:
        left_bytes: the one that left may have written something that was not taken yet.
        new_bytes: the one that came has written.
        reads: the one that came has read.
    """

    left_bytes: bool
    new_bytes: bool = False
    reads: bool = False

    def divide(self, data: bytes) -> int:
        """Find where the newcomer's bytes begin; nothing in them tells."""
        if not self.left_bytes:
            return 0
        if not self.new_bytes:
            return len(data)
        # a newcomer has hardly sent more than one request within a moment
        return data.rstrip(b"\r\n").rfind(b"\n") + 1


class PtyPort:
    """Master side of a pseudo-terminal.

    Args:
        moved: told the path of the new terminal when the line moves to one.

    Attributes:
        dropped: bytes to clients that did not fit because they do not read.

    Raises:
        EmulatorError: the system gives none.
    """

    def __init__(self, moved: Callable[[str], None] = lambda _: None) -> None:
        self.dropped = 0
        self._moved = moved
        self._terminal = Terminal()
        self._clients = 0
        self._kept_back = self._known = False

    @classmethod
    def opened(cls, request: PortRequest) -> Self:
        """Open a terminal; it has no address.

        Raises:
            EmulatorError: the system gives none.
        """
        if request.address:
            raise EmulatorError(f"a terminal has no address, not {quoted(request.address)}")
        return cls(request.moved)

    def close(self) -> None:
        """Hang up: clients get an error from now on."""
        self._terminal.close()

    @property
    def url(self) -> str:
        """Path of the terminal, which a pySerial client opens."""
        return self._terminal.path

    def descriptors(self, *, room: bool, answered: bool = True) -> tuple[int, ...]:
        """Return descriptors that become readable when clients come, write or leave."""
        del answered  # who has a terminal open can listen
        return self._terminal.descriptors(room=room)

    def settings(self) -> LineFormat | None:
        """Return what the client has set; None for a rate of zero.

        A pseudo-terminal has eight data bits and no parity, whatever its clients ask for.
        """
        return self._terminal.settings()

    def receive(self, limit: int, *, answered: bool = True) -> list[bytes]:
        """Return what clients have done since the last call, in order.

        Args:
            limit: bytes to take at most; the rest stays with the client.
            answered: makes no difference here.

        Returns:
            Bytes that were written; an empty chunk says that the client has left.

        Raises:
            EmulatorError: the terminal is lost, and the system gives no other.
        """
        del answered
        chunks = self._receive(limit)
        for chunk in chunks:
            if bool(chunk) != self._known:
                self._known = bool(chunk)
                _log.info("%s: %s", self.url, "a client writes" if chunk else "it has left")
        return chunks

    def _receive(self, limit: int) -> list[bytes]:
        """Return what clients have done since the last call, as `receive`."""
        kept_back = self._kept_back
        try:
            data, events = self._look(limit)
        except EOFError:
            self._forget_client()
            return [b""]
        if not self._terminal.held and COMINGS.isdisjoint(events):
            return [data] if data else []
        change = self._count(events)
        left = any(event in _CLOSED for event in events)
        if data or WRITTEN in events:
            self._terminal.let_go()
        elif self._terminal.held and events and (left or not self._clients):
            self._hold(drop=not self._clients)  # who has looked in may have been told something
        if not self._terminal.held and not self._clients:
            if left:
                follower = self._settle()
                if not self._clients:
                    return self._end(data)
                if follower:
                    # what is at hand was written by the one that left
                    follower.left_bytes = follower.left_bytes or bool(data)
                    change = follower
            else:
                self._clients = 1  # it has come when we opened the terminal, and both as one
        if change:
            change.left_bytes = change.left_bytes or kept_back
            return self._change_client(change, data)
        return [data] if data else []

    def changed(self) -> bool:
        """Tell whether clients have come or left since the last look."""
        return self._terminal.changed()

    def write(self, data: bytes) -> None:
        """Hand bytes to the client; never waits. What nobody listens to is lost, not kept."""
        if self._clients or not self._terminal.held:
            self.dropped += len(data) - self._terminal.write(data)

    def _look(self, limit: int) -> tuple[bytes, tuple[int, ...]]:
        """Return what was written, and the events up to it; neither is ahead of the other.

        Raises:
            EOFError: nothing, and nobody has the terminal open.
        """
        terminal = self._terminal
        data = terminal.read(limit) if limit > 0 else b""
        # only now: whoever wrote this had opened the terminal before
        events = news = terminal.events()
        for _ in range(_LOOKS):
            # it may have been written since: otherwise a later client would pass for its writer
            if WRITTEN not in news or len(data) >= limit or not terminal.readable():
                self._kept_back = len(data) >= limit
                return data, events
            with suppress(EOFError):
                data += terminal.read(limit - len(data))
            news = terminal.events()
            events += news
        self._kept_back = True
        return data, events

    def _count(self, events: tuple[int, ...]) -> _Change | None:
        """Keep count of clients; tells if one has followed another one.

        Events that came as one make the count wrong, until the last client leaves.
        """
        change = None
        before = not self._terminal.held  # otherwise nobody has asked for anything
        written = read = False
        for event in events:
            if event == OPENED:
                if before and self._clients == 0:
                    # also one before those who have left, and who have written nothing
                    written = written or bool(change and change.left_bytes)
                    change = _Change(left_bytes=written)
                    written = read = False
                self._clients += 1
            elif event == WRITTEN:
                written = True
            elif event == READ:
                read = True
            elif event in _CLOSED:
                before = before or written
                self._clients = max(0, self._clients - 1)
        if change:
            change.new_bytes, change.reads = written, read
        return change

    def _settle(self) -> _Change | None:
        """Wait until the last client has left, as the count says, or that is known to be wrong.

        The hang-up comes a little after the event of the closing, and not at all if somebody has
        opened the terminal meanwhile. Where neither follows, two clients have come as one.
        """
        change = None
        while not self._clients:
            hung_up, told = self._terminal.wait_for_news(_TELLING)
            if told:
                events = self._terminal.events()
                change = self._count(events) or change
                self._kept_back = self._kept_back or WRITTEN in events
            elif hung_up:
                break
            else:
                self._clients = 1
        return change

    def _end(self, data: bytes) -> list[bytes]:
        """Return what the last client has left behind, unless another one comes just now."""
        data += self._terminal.read_all()
        change = self._count(self._terminal.events())
        if change:  # it may have written, too
            change.left_bytes = True
            return self._change_client(change, data)
        self._forget_client()
        return [data, b""] if data else [b""]

    def _change_client(self, change: _Change, data: bytes) -> list[bytes]:
        """Divide what was written between one client and the one that has followed it."""
        for _ in range(_LOOKS):
            data += self._terminal.read_all()
            if data and not change.new_bytes:
                # bytes are there a little before the event that tells of them
                self._terminal.wait_for_news(_TELLING)
            events = self._terminal.events()
            if not events:
                break
            later = self._count(events)
            if later:
                later.left_bytes = True
                change = later
            change.new_bytes = change.new_bytes or WRITTEN in events
            change.reads = change.reads or READ in events
        self._put_right(drop=not change.reads)  # otherwise it would find the rest of a line
        cut = change.divide(data)
        return [*filter(None, (data[:cut],)), b"", *filter(None, (data[cut:],))]

    def _put_right(self, *, drop: bool) -> None:
        """Undo what the client before has left, for one that has come already.

        Args:
            drop: take away what it was told and has not read.
        """
        with suppress(TerminalLostError):  # the new client keeps us out: it may find stale bytes
            self._terminal.hold()
            if drop:
                self._terminal.drop_unread()
        self._terminal.let_go()

    def _forget_client(self) -> None:
        """Nobody has the terminal open: what was said and not read is lost."""
        self._hold(drop=True)
        self._clients = 0
        events = self._terminal.events()
        if OPENED in events:  # somebody has come since, and may have left again
            self._terminal.put_back(events[events.index(OPENED) :])

    def _hold(self, *, drop: bool) -> None:
        """Hold the terminal open, or a new one if nobody can open it any more."""
        try:
            self._terminal.hold()
            if drop:
                self._terminal.drop_unread()
        except TerminalLostError as error:
            self._move(error)

    def _move(self, why: TerminalLostError) -> None:
        """Go on with another terminal, with the settings of this one."""
        lost, self._terminal = self._terminal, Terminal()
        self._terminal.copy_settings(lost)
        lost.close()
        _log.warning("%s: the line has moved to %s", why, self.url)
        try:
            self._moved(self.url)
        except EmulatorError as error:
            _log.warning("%s", error)
