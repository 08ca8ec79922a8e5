"""A queue between the threads of Zenoh and one that may be slower: bounded, and it counts.

What is left out is always the oldest, so that a watcher who catches up sees what is going on now.
"""

import threading
from collections import deque
from typing import Final, Generic, TypeVar

_T = TypeVar("_T")

MOST_ITEMS: Final = 10_000
MOST_BYTES: Final = 64_000_000
"""Samples that wait at most: some seconds of one robot."""

_MOST_NOTICES: Final = 1_000


class Inbox(Generic[_T]):
    """Takes items from any thread, and gives them in their order.

    Args:
        items: greatest number of samples that wait.
        size: greatest sum of their bytes.
    """

    def __init__(self, items: int = MOST_ITEMS, size: int = MOST_BYTES) -> None:
        self._most_items = items
        self._most_bytes = size
        self._came = threading.Condition()
        self._order = 0
        self._bytes = 0
        self._lost = 0
        # notices (of who comes and goes) wait beside the samples, which cannot crowd them out
        self._samples: deque[tuple[int, int, _T]] = deque()
        self._notices: deque[tuple[int, int, _T]] = deque(maxlen=_MOST_NOTICES)

    def put(self, sample: _T, size: int) -> None:
        """Add a sample of so many bytes; the oldest ones make room for it."""
        with self._came:
            self._order += 1
            self._samples.append((self._order, size, sample))
            self._bytes += size
            while len(self._samples) > self._most_items or self._bytes > self._most_bytes:
                self._bytes -= self._samples.popleft()[1]
                self._lost += 1
            self._came.notify()

    def notify(self, notice: _T) -> None:
        """Add what must not be left out for the sake of samples."""
        with self._came:
            self._order += 1
            self._notices.append((self._order, 0, notice))
            self._came.notify()

    def get(self, timeout: float) -> _T | None:
        """Return the next item; None when there is none for so many seconds."""
        with self._came:
            if not self._came.wait_for(lambda: self._samples or self._notices, timeout):
                return None
            waiting = [queue for queue in (self._samples, self._notices) if queue]
            _, size, item = min(waiting, key=lambda queue: queue[0][0]).popleft()
            self._bytes -= size
            return item

    def take_losses(self) -> int:
        """Return how many samples were left out since the last call."""
        with self._came:
            lost, self._lost = self._lost, 0
            return lost
