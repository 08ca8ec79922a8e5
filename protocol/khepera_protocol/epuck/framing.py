"""Bytes of a client to requests, as the firmware's loop takes them.

A byte of 128 or more begins a row of binary commands, which ends with 0; any other byte but 0
begins a line of text. Line ends ahead of a line are skipped: so after CR LF the robot waits for
text, and a binary row that follows at once is swallowed up to the next line end, as on the robot.

A command of a row is carried out when its last byte is there, and not at the row's end.
"""

import re
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final

from khepera_protocol.epuck.codes import END, Code, Codes
from khepera_protocol.epuck.letters import Line

_LINE_END: Final = re.compile(rb"[\r\n]")
_FIRST_BINARY: Final = 0x80


@dataclass(frozen=True, slots=True)
class Command:
    """A command of a binary row with its parameters."""

    code: Code
    parameters: bytes = b""


class Sign(Enum):
    """Requests that are neither a line nor a command."""

    ROW_END = auto()
    """The end of a binary row: its answers are due."""

    RESTART = auto()
    """Switching off and on; it does not come on the line."""


class _State(Enum):
    IDLE = auto()
    LINE = auto()
    ROW = auto()


class RequestSplitter:
    """Cuts what a client sends into lines of text, commands of rows, and their ends.

    Args:
        codes: binary commands of the firmware; the bytes of others are ignored.
        longest: bytes of a line; more are dropped.
    """

    def __init__(self, codes: Codes, longest: int) -> None:
        self._codes = codes
        self._longest = longest
        self._state = _State.IDLE
        self._held = bytearray()
        self._code: Code | None = None

    def end(self, data: bytearray, limit: int) -> int:
        """Find where the next portion ends, of which only the last byte can complete a request.

        Args:
            data: what comes next.
            limit: so many of its bytes count.

        Returns:
            The number of bytes up to there; 0 if that lies beyond the limit.
        """
        if not limit:
            return 0
        first = data[0]
        if self._state is _State.LINE or (self._state is _State.IDLE and 0 < first < _FIRST_BINARY):
            found = _LINE_END.search(data, 0, limit)
            return found.end() if found else 0
        if self._code is not None:
            size = self._code.parameters - len(self._held)
        else:
            code = self._codes.get(first)
            size = 1 if code is None else 1 + code.parameters
        return size if size <= limit else 0

    def take(self, data: bytes) -> Line | Command | Sign | None:
        """Take in a portion, or a part of one; return the request that is complete now."""
        if self._state is _State.IDLE:
            first = data[0]
            if not first:
                return None
            self._state = _State.ROW if first >= _FIRST_BINARY else _State.LINE
        return self._take_line(data) if self._state is _State.LINE else self._take_command(data)

    def clear(self) -> None:
        """Forget what is half received."""
        self._state = _State.IDLE
        self._held.clear()
        self._code = None

    def _take_line(self, data: bytes) -> Line | None:
        held = self._held
        ended = data[-1] in b"\r\n"
        held += (data[:-1] if ended else data)[: self._longest - len(held)]
        if not ended or not held:  # an end without a line is skipped, as ahead of one
            return None
        line = Line(bytes(held))
        self.clear()
        return line

    def _take_command(self, data: bytes) -> Command | Sign | None:
        if self._code is None:
            byte, data = data[0], data[1:]
            if byte == END:
                self.clear()
                return Sign.ROW_END
            self._code = self._codes.get(byte)
            if self._code is None:
                return None
        self._held += data
        if len(self._held) < self._code.parameters:
            return None
        command = Command(self._code, bytes(self._held))
        self._held.clear()
        self._code = None
        return command
