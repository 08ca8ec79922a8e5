"""Bytes on their way, each with the time at which it is there."""

from collections import deque
from collections.abc import Iterable


class TimedBytes:
    """A queue of bytes whose times never fall.

    Bytes that follow each other on a wire come at equal distances: they are kept as runs. With
    times on a grid of a power of two (see `clock.GRID`) that is exact.

    Attributes:
        data: the bytes, to look at.
    """

    def __init__(self) -> None:
        self.data = bytearray()
        self._runs: deque[tuple[float, float, int]] = deque()

    def add(self, data: bytes, start: float, each: float) -> float:
        """Append bytes that set out one after the other; returns when the last one is there.

        Args:
            data: the bytes.
            start: when the first one sets out.
            each: seconds that every byte takes.
        """
        if data:
            self.data += data
            self._runs.append((start, each, len(data)))
        return start + each * len(data)

    def add_each(self, items: Iterable[tuple[float, int]]) -> None:
        """Append bytes with a time of its own for each."""
        for when, byte in items:
            self.data.append(byte)
            self._runs.append((when, 0.0, 1))

    def arrived(self, now: float) -> int:
        """Count the bytes that are there by now."""
        total = 0
        for start, each, count in self._runs:
            if start + each * count > now:
                if each and now > start:
                    total += int((now - start) / each)
                break
            total += count
        return total

    def due(self, count: int) -> float:
        """Return when the first `count` bytes are there; there are so many, and at least one."""
        for start, each, length in self._runs:
            if count <= length:
                return start + each * count
            count -= length
        raise IndexError("not so many bytes are on their way")

    def take_whole(self, size: int, idle: float, until: float) -> tuple[float, bytes] | None:
        """Remove all if it is so many bytes that follow each other on the wire: the usual case.

        Args:
            size: the number of bytes that make a request.
            idle: they must not have set out before.
            until: they must be there by this time.

        Returns:
            When the last byte is there, and the bytes; None leaves everything to the caller.
        """
        if len(self._runs) != 1:
            return None
        start, each, count = self._runs[0]
        due = start + each * count
        if start < idle or due > until or size != count:
            return None
        data = bytes(self.data)
        self.clear()
        return due, data

    def take(self, count: int) -> bytes:
        """Remove the first `count` bytes, or all if there are fewer."""
        if count >= len(self.data):
            data = bytes(self.data)
            self.clear()
            return data
        data = bytes(self.data[:count])
        del self.data[:count]
        left = len(data)
        runs = self._runs
        while left:
            start, each, length = runs.popleft()
            if length > left:
                runs.appendleft((start + each * left, each, length - left))
                break
            left -= length
        return data

    def keep(self, count: int) -> None:
        """Drop all behind the first `count` bytes."""
        del self.data[count:]
        runs, self._runs = self._runs, deque()
        for start, each, length in runs:
            if count > 0:
                self._runs.append((start, each, min(length, count)))
            count -= length

    def clear(self) -> None:
        """Drop all."""
        self.data.clear()
        self._runs.clear()
