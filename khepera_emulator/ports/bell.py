"""A descriptor by which one thread wakes another that waits for descriptors."""

import os
import threading
from contextlib import suppress
from typing import Final

_CLOSED: Final = -1


class Bell:
    """Readable from `ring` until `silence`.

    It may be rung from other threads and from signal handlers at any time, also after it was
    closed: the descriptor's number may belong to another file by then, which is not touched.
    """

    def __init__(self) -> None:
        self._descriptor = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._lock = threading.RLock()  # a signal's handler may run while its own thread holds it

    def fileno(self) -> int:
        """Return the descriptor to wait for."""
        return self._descriptor

    def ring(self) -> None:
        """Make the descriptor readable; after `close` nothing happens."""
        with self._lock:
            if self._descriptor != _CLOSED:
                os.eventfd_write(self._descriptor, 1)

    def silence(self) -> None:
        """Make it unreadable again."""
        with suppress(BlockingIOError):
            os.eventfd_read(self._descriptor)

    def close(self) -> None:
        """Give the descriptor back; a second time nothing happens."""
        with self._lock:
            descriptor, self._descriptor = self._descriptor, _CLOSED
        if descriptor != _CLOSED:
            os.close(descriptor)
