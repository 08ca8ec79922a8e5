"""Says that something takes longer than it should while it still does."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from typing import Final, Self

from macor_hil.errors import MacorError
from macor_hil.safety.helper_thread import HelperThread

_ANSWER: Final = 2.0
"""Seconds that the thread may take to say whether the bell has rung."""


class LateBell:
    """Rings in a thread of its own; use as a context around all that is timed.

    Args:
        limit: seconds that something may take.
        ring: called once when it has taken longer, in the bell's thread.
    """

    def __init__(self, limit: float, ring: Callable[[], object]) -> None:
        self._limit = limit
        self._ring = ring
        self._marks: SimpleQueue[bool] = SimpleQueue()  # True: a beginning, then an end
        self._rung: SimpleQueue[bool] = SimpleQueue()
        self._thread = HelperThread(self._run, "late bell")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._marks.put(False)

    @contextmanager
    def timing(self, afterwards: Callable[[], None]) -> Iterator[None]:
        """Time what happens within.

        Args:
            afterwards: called at the end if the bell has rung.

        Raises:
            MacorError: the bell is broken.
        """
        self._marks.put(True)
        try:
            yield
        finally:
            self._marks.put(True)
            if self._has_rung():
                afterwards()

    def _has_rung(self) -> bool:
        try:
            return self._rung.get(timeout=0.0 if self._thread.ended() else _ANSWER)
        except Empty:
            why = self._thread.ended() or "its thread does not answer"
            raise MacorError(f"the time of planning is not watched any more: {why}") from None

    def _run(self) -> None:
        while self._marks.get():
            rung = False
            try:
                more = self._marks.get(timeout=self._limit)
            except Empty:
                rung = True
                self._ring()
                more = self._marks.get()
            if not more:
                break
            self._rung.put(rung)
