"""A thread beside the one that drives, whose end is heard."""

import threading
from collections.abc import Callable
from typing import Final

END_PATIENCE: Final = 0.1
"""Seconds that is waited for a thread to end: no stop of a robot is later by more."""


class HelperThread(threading.Thread):
    """A daemon thread that somebody relies on.

    Who drives shares nothing with it that has a lock of Python's own (Event, Condition, Queue): a
    Ctrl-C within one of their methods leaves the lock locked, and the end would hang. Plain
    attributes and SimpleQueue, which is written in C, do.

    Args:
        work: what it does; whoever relies on it sees to it that this ends.
        name: what errors call it.
    """

    def __init__(self, work: Callable[[], None], name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._work = work
        self._ended = ""

    def run(self) -> None:
        """Do the work; an error is printed, and kept for `ended`."""
        try:
            self._work()
            self._ended = f"the thread {self.name!r} has come to its end"
        except BaseException as error:
            self._ended = f"the thread {self.name!r} has failed: {type(error).__name__}: {error}"
            raise

    def ended(self) -> str:
        """Say why the thread has ended; empty while it works."""
        return self._ended
