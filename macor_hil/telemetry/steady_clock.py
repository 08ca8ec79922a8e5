"""The wall clock as it was at the start, carried on by one that never jumps."""

import time


class SteadyClock:
    """A wall clock that does not follow later changes of the machine's."""

    def __init__(self) -> None:
        self._zero = time.time_ns() - time.monotonic_ns()

    def __call__(self) -> int:
        """Return nanoseconds since 1970."""
        return self._zero + time.monotonic_ns()

    def seconds(self) -> float:
        """Return the same in seconds."""
        return self() * 1e-9
