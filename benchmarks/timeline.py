"""The timeline of the thread that drives, and the time of each part of a decision."""

import threading
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import wraps
from time import perf_counter
from typing import Any
from unittest.mock import patch

from stopwatch import Part


class Timeline:
    """Real time of each part, without the parts that it calls, from a beginning to an end.

    Args:
        begin: entering this begins a measurement.
        end: entering this ends it, once `ends` says so of its arguments.
        parts: names and what goes under them; `begin` may be one of them.

    Attributes:
        found: seconds of each part, and in all under "", for each measurement.
    """

    def __init__(
        self, begin: Part, end: Part, parts: Sequence[tuple[str, Part]], ends: Callable[..., bool]
    ) -> None:
        self.found: list[dict[str, float]] = []
        self._begin, self._end, self._parts, self._ends = begin, end, parts, ends
        self._seconds: dict[str, float] = defaultdict(float)
        self._start: float | None = None
        self._inner: list[float] = []
        self._thread = threading.current_thread()

    @contextmanager
    def watch(self) -> Iterator[None]:
        """Measure while the context lasts, in this thread alone."""
        with ExitStack() as stack:
            for name, (owner, attribute) in self._parts:
                timed = self._timed(name, getattr(owner, attribute))
                stack.enter_context(patch.object(owner, attribute, timed))
            for (owner, attribute), act in ((self._begin, self._began), (self._end, self._ended)):
                marked = self._marked(act, getattr(owner, attribute))
                stack.enter_context(patch.object(owner, attribute, marked))
            yield

    def _began(self, *_: Any) -> None:
        self._seconds.clear()
        self._start = perf_counter()

    def _ended(self, *arguments: Any) -> None:
        if self._start is not None and self._ends(*arguments):
            self.found.append({**self._seconds, "": perf_counter() - self._start})
            self._start = None

    def _marked(self, act: Callable[..., None], function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def marked(*args: Any, **kwargs: Any) -> Any:
            if threading.current_thread() is self._thread:
                act(*args)
            return function(*args, **kwargs)

        return marked

    def _timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def timed(*args: Any, **kwargs: Any) -> Any:
            if threading.current_thread() is not self._thread:
                return function(*args, **kwargs)
            self._inner.append(0.0)
            start = perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                taken = perf_counter() - start
                self._seconds[name] += taken - self._inner.pop()
                if self._inner:
                    self._inner[-1] += taken

        return timed
