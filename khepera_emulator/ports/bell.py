"""A descriptor by which one thread wakes another that waits for descriptors."""

import socket
import threading
from contextlib import suppress
from typing import Final

_PIECE: Final = 4096


class Bell:
    """Readable from `ring` until `silence`.

    It may be rung from other threads and from signal handlers at any time, also after it was
    closed: the descriptor's number may belong to another file by then, which is not touched.
    """

    def __init__(self) -> None:
        # sockets can be waited for everywhere
        self._ear, self._clapper = socket.socketpair()
        for end in (self._ear, self._clapper):
            end.setblocking(False)
        self._lock = threading.RLock()  # a signal's handler may run while its own thread holds it

    def fileno(self) -> int:
        """Return the descriptor to wait for."""
        return self._ear.fileno()

    def ring(self) -> None:
        """Make the descriptor readable; after `close` nothing happens."""
        with self._lock, suppress(OSError):  # it rings for as much as it holds, or is closed
            self._clapper.send(b"!")

    def silence(self) -> None:
        """Make it unreadable again."""
        with suppress(BlockingIOError):
            while self._ear.recv(_PIECE):
                pass

    def close(self) -> None:
        """Give the descriptors back; a second time nothing happens."""
        with self._lock:
            self._clapper.close()
            self._ear.close()
