"""Failures of the page itself: shown in the page, and logged once."""

import logging

from khepera_protocol.text import printable


class Failures:
    """Counts exceptions of the page's callbacks, which NiceGUI would log ten times a second."""

    def __init__(self) -> None:
        self._count = 0
        self._last = ""

    def add(self, error: Exception) -> None:
        """Count an exception."""
        self._count += 1
        self._last = printable(f"{type(error).__name__}: {error}", 200)

    def words(self) -> str:
        """Return how many there were, and the last one; empty when all is well."""
        if not self._count:
            return ""
        return f"the page failed {self._count} times, please report it: {self._last}"


class OnceEach(logging.Filter):
    """Lets an exception through once for each place that it is raised at."""

    def __init__(self) -> None:
        super().__init__()
        self._seen: set[tuple[object, ...]] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a record is new."""
        if not record.exc_info or record.exc_info[0] is None:
            return True
        trace = record.exc_info[2]
        while trace and trace.tb_next:
            trace = trace.tb_next
        place = (record.exc_info[0], trace and (trace.tb_frame.f_code, trace.tb_lineno))
        new = place not in self._seen
        self._seen.add(place)
        return new
