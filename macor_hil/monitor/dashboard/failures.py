"""Failures of the dashboard itself: shown in the page, and logged once for each place."""

import logging
from types import TracebackType
from typing import Self

from khepera_protocol.text import printable

_log = logging.getLogger(__name__)


class Failures:
    """Counts exceptions that would end a page's updates; as a context it takes them."""

    def __init__(self) -> None:
        self._count = 0
        self._last = ""
        self._seen: set[tuple[object, ...]] = set()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> bool:
        if not isinstance(error, Exception):
            return False  # nothing failed, or the process is told to end
        self._count += 1
        self._last = printable(f"{type(error).__name__}: {error}", 200)
        while trace and trace.tb_next:
            trace = trace.tb_next
        place = (kind, trace and (trace.tb_frame.f_code, trace.tb_lineno))
        if place not in self._seen:
            self._seen.add(place)
            _log.error("the dashboard failed", exc_info=error)
        return True

    def words(self) -> str:
        """Return how many there were, and the last one; empty when all is well."""
        if not self._count:
            return ""
        return f"the page failed {self._count} times, please report it: {self._last}"
