"""Events of a file, opened, read, written and closed: a small part of Linux's inotify."""

import ctypes
import os
import struct
from typing import Final

from khepera_emulator.errors import EmulatorError

READ: Final = 0x01
WRITTEN: Final = 0x02
CLOSED_WRITABLE: Final = 0x08
CLOSED_READABLE: Final = 0x10
OPENED: Final = 0x20
COMINGS: Final = frozenset((OPENED, CLOSED_WRITABLE, CLOSED_READABLE))
"""Events of coming and leaving."""

_WANTED = READ | WRITTEN | CLOSED_WRITABLE | CLOSED_READABLE | OPENED
_EVENT = struct.Struct("iIII")
_BUFFER = 4096
_EXCHANGE: Final = (READ, WRITTEN)


class Watch:
    """Watch on what processes do with one file.

    Raises:
        EmulatorError: this system has no inotify.
    """

    def __init__(self, path: str) -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        try:
            self._fd: int = libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
        except AttributeError:
            raise EmulatorError("a pseudo-terminal needs inotify, which only Linux has") from None
        if self._fd < 0:
            raise _failure(path)
        number = libc.inotify_add_watch(self._fd, os.fsencode(path), _WANTED)
        if number < 0:
            self.close()
            raise _failure(path)
        self._exchange = b"".join(_EVENT.pack(number, event, 0, 0) for event in _EXCHANGE)

    def fileno(self) -> int:
        """Return a descriptor that becomes readable with an event."""
        return self._fd

    def close(self) -> None:
        """Stop watching."""
        os.close(self._fd)

    def take(self) -> tuple[int, ...]:
        """Return what has happened since the last call, in order.

        Equal events in a row come as one.
        """
        try:
            events = os.read(self._fd, _BUFFER)
        except BlockingIOError:
            return ()
        # by far the most frequent: a client has read a reply and written a request
        if events == self._exchange:
            return _EXCHANGE
        # events of a watched file carry no name: all are of one size
        return tuple(mask for _, mask, _, _ in _EVENT.iter_unpack(events))


def _failure(path: str) -> EmulatorError:
    return EmulatorError(f"cannot watch {path}: {os.strerror(ctypes.get_errno())}")
