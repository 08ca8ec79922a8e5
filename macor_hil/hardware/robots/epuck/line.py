"""A serial line to an e-puck: binary rows and text out, answers in, within a time."""

from typing import Final

from khepera_protocol.epuck.letters import GREETING, request

from macor_hil.errors import GarbageError, SilenceError
from macor_hil.hardware.line.open_line import BABBLE, PORT_ERRORS, QUIET, OpenLine, port_failed

PATIENCE: Final = 0.15
"""Seconds beyond the wire time that an answer may take; Bluetooth takes up to 50 ms."""

_BITS: Final = 10
_LONGEST_LINE: Final = 120
_WELCOME: Final = GREETING[2:9]

_FLUSH: Final = bytes(40) + b"\rC\r"
"""Ends whatever was begun: the parameters of a command, a row, a line of text. A whole request
comes last: behind a line end alone the robot would wait for text."""


class EpuckLine(OpenLine):
    """Rows and lines over an open port; see `OpenLine`."""

    def ask(self, row: bytes, size: int) -> bytes:
        """Send a row and wait for so many bytes of answers.

        Raises:
            SilenceError: they did not come in time.
            RobotResetError: the robot's greeting came instead.
            LinkError: the port failed.
        """
        try:
            self.port.write(row)
            return self._read(row, size)
        except PORT_ERRORS as error:
            raise port_failed(row, error) from None

    def say(self, letter: str, *numbers: int) -> bytes:
        """Send a request in text; returns the line of its reply, without its end.

        Raises:
            SilenceError: no whole line came in time.
            LinkError: the port failed.
        """
        data = request(letter, *numbers)
        try:
            self.port.write(data)
            start, line = self.clock(), b""
            limit = PATIENCE + _LONGEST_LINE * _BITS / self.baud
            while not line.endswith(b"\n") and self.clock() - start < limit:
                line += self.port.read_until(b"\n", _LONGEST_LINE)
        except PORT_ERRORS as error:
            raise port_failed(data, error) from None
        if not line.endswith(b"\n"):
            raise SilenceError(
                f"sent {data!r} and got {line!r}; is the robot on, and at {self.baud} baud?",
                data,
                line,
            )
        return line.rstrip(b"\r\n")

    def clear(self, data: bytes = b"") -> None:
        """End a half-sent request, send a row, and drop what comes until it is quiet.

        Raises:
            LinkError: the port failed.
            GarbageError: what is on it never pauses.
        """
        try:
            self.port.write(_FLUSH + data)
            start, came = self.clock(), b"x"
            while came or self.clock() - start < QUIET:
                if self.clock() - start > BABBLE:
                    raise GarbageError(
                        f"bytes have not stopped coming for {BABBLE} s, the last ones"
                        f" {came[-20:]!r}; is this an e-puck's port, at {self.baud} baud?",
                        _FLUSH,
                        came,
                    )
                came = bytes(self.port.read(256))
                self.reset_seen = self.reset_seen or _WELCOME in came
        except PORT_ERRORS as error:
            raise port_failed(_FLUSH, error) from None

    def _read(self, row: bytes, size: int) -> bytes:
        start = self.clock()
        limit = PATIENCE + (len(row) + size) * _BITS / self.baud
        data = bytes(self.port.read(size))
        while len(data) < size and self.clock() - start < limit:
            data += self.port.read(size - len(data))
        if _WELCOME in data:
            raise self.restarted(row, data)
        if len(data) < size:
            raise SilenceError(
                f"sent {row!r} and got {len(data)} of {size} bytes within {limit:.2f} s; is the"
                f" robot on, and at {self.baud} baud?",
                row,
                data,
            )
        return data
