"""Who opens, writes and closes a file: a small part of Linux's inotify."""

import ctypes
import os
import struct
from typing import Final

from khepera_emulator.errors import EmulatorError

WRITTEN: Final = 0x02
CLOSED_WRITABLE: Final = 0x08
CLOSED_READABLE: Final = 0x10
OPENED: Final = 0x20

_WANTED = WRITTEN | CLOSED_WRITABLE | CLOSED_READABLE | OPENED
_EVENT = struct.Struct("iIII")
_BUFFER = 4096


class Watch:
    """Tells what processes do with one file.

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
        if libc.inotify_add_watch(self._fd, os.fsencode(path), _WANTED) < 0:
            self.close()
            raise _failure(path)

    def fileno(self) -> int:
        """Descriptor that becomes readable with an event."""
        return self._fd

    def close(self) -> None:
        """Stop watching."""
        os.close(self._fd)

    def take(self) -> list[int]:
        """What has happened since the last call, in order.

        Equal events in a row come as one.
        """
        try:
            events = os.read(self._fd, _BUFFER)
        except BlockingIOError:
            return []
        # events of a watched file carry no name: all are of one size
        return [mask for _, mask, _, _ in _EVENT.iter_unpack(events)]


def _failure(path: str) -> EmulatorError:
    return EmulatorError(f"cannot watch {path}: {os.strerror(ctypes.get_errno())}")
