"""Bytes to lines and back.

A request ends with LF, CR or CR LF, a reply with CR LF. Both splitters take bytes in portions
of any size and hold what is not yet a line.
"""

import re
from typing import Final

LINE_END: Final = b"\r\n"
REQUEST_LIMIT: Final = 128
"""Bytes in the longest request a robot takes in (the buffer of the ROM's console)."""

REQUEST_END: Final = re.compile(rb"[\r\n]")
"""A byte that ends a request."""

_ENDS = (b"\r", b"\n")
_NUL = b"\0"


class RequestSplitter:
    """Cuts what a client sends into requests.

    An empty line is no request, so that the LF of a CR LF does nothing, however late it comes. NUL
    bytes are nothing, wherever they come: a break leaves one, and so does the end of a C string.
    A line longer than `limit` is dropped up to its end and handed on as `OVERFLOW`, which no
    command matches.
    """

    OVERFLOW: Final = b"?"

    def __init__(self, limit: int = REQUEST_LIMIT) -> None:
        self._limit = limit
        self._line = bytearray()

    def end(self, data: bytearray, limit: int) -> int:
        """Count the bytes up to and with the first line end among so many; 0 if there is none."""
        found = REQUEST_END.search(data, 0, limit)
        return found.end() if found else 0

    def take(self, data: bytes) -> bytes | None:
        """Take in bytes of which the last one alone may end a line.

        Returns:
            The request that is complete now, without its line end.
        """
        line = self._line
        if _NUL in data:
            data = data.replace(_NUL, b"")
        if data[-1:] not in _ENDS:
            line += data[: self._limit + 1 - len(line)]
            return None
        if not line:
            whole = data[:-1]
        else:
            whole = bytes(line) + data[:-1]
            line.clear()
        return (whole if len(whole) <= self._limit else self.OVERFLOW) or None

    @property
    def empty(self) -> bool:
        """True if no half-received line is held."""
        return not self._line

    def feed(self, data: bytes) -> list[bytes]:
        """Take in bytes; return the requests completed by them."""
        parts = REQUEST_END.split(data)
        taken = [self.take(part + LINE_END[:1]) for part in parts[:-1]] + [self.take(parts[-1])]
        return [line for line in taken if line is not None]

    def clear(self) -> None:
        """Forget a half-received line."""
        self._line.clear()


class ReplySplitter:
    """Cuts what a robot sends into lines without their ends; blank lines are skipped."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Take in bytes; return the lines completed by them."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [line for line in (whole.rstrip(b"\r") for whole in lines) if line]

    @property
    def pending(self) -> bytes:
        """The bytes of a line that is not complete yet."""
        return self._rest

    def clear(self) -> None:
        """Forget a half-received line."""
        self._rest = b""
