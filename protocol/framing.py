"""Bytes to lines and back.

A request ends with LF, CR or CR LF, a reply with CR LF. Both splitters take bytes in portions
of any size and hold what is not yet a line.
"""

from typing import Final

LINE_END: Final = b"\r\n"
REQUEST_LIMIT: Final = 128
"""Bytes in the longest request a robot takes in (the buffer of the ROM's console)."""

_CR, _LF = LINE_END


class RequestSplitter:
    """Cuts what a client sends into requests.

    An empty line is no request, so that the LF of a CR LF does nothing, however late it comes. A
    line longer than `limit` is dropped up to its end and handed on as `OVERFLOW`, which no
    command matches.
    """

    OVERFLOW: Final = b"?"

    def __init__(self, limit: int = REQUEST_LIMIT) -> None:
        self._limit = limit
        self._line = bytearray()

    def push(self, byte: int) -> bytes | None:
        """Take in one byte; return the request that it completes, without its line end."""
        if byte in (_CR, _LF):
            line = bytes(self._line)
            self._line.clear()
            return (line if len(line) <= self._limit else self.OVERFLOW) or None
        if len(self._line) <= self._limit:
            self._line.append(byte)
        return None

    def feed(self, data: bytes) -> list[bytes]:
        """Take in bytes; return the requests completed by them."""
        return [line for byte in data if (line := self.push(byte)) is not None]

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
        """What has come of a line that is not complete yet."""
        return self._rest

    def clear(self) -> None:
        """Forget a half-received line."""
        self._rest = b""
