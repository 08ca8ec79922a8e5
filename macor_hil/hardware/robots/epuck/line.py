"""A serial line to an e-puck: binary rows and text out, answers in, within a time."""

import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

import serial
from khepera_protocol.epuck.letters import GREETING, request

from macor_hil.errors import GarbageError, LinkError, RobotResetError, SilenceError

PATIENCE: Final = 0.15
"""Seconds beyond the wire time that an answer may take; Bluetooth takes up to 50 ms."""

QUIET: Final = 0.05
"""Seconds without a byte after which nothing more is taken to be on its way."""

_BABBLE: Final = 1.0
_BITS: Final = 10
_LONGEST_LINE: Final = 120
_WELCOME: Final = GREETING[2:9]

_FLUSH: Final = bytes(40) + b"\rC\r"
"""Ends whatever was begun: the parameters of a command, a row, a line of text. A whole request
comes last: behind a line end alone the robot would wait for text."""


class EpuckLine:
    """Rows and lines over an open port.

    Attributes:
        port: the pySerial port.
        clock: seconds on the clock that the port lives by: virtual for `khepera://`, else real.
        reset_seen: whether a robot's greeting has come since this was last set to False.
    """

    def __init__(self, port: Any) -> None:
        self.port = port
        self.emulated = hasattr(port, "now")
        self.clock: Callable[[], float] = (lambda: port.now) if self.emulated else time.monotonic
        self.reset_seen = False
        if port.timeout != QUIET:
            port.timeout = QUIET

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
        except (OSError, serial.SerialException) as error:
            raise _failed(row, error) from None

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
            limit = PATIENCE + _LONGEST_LINE * _BITS / self._baud
            while not line.endswith(b"\n") and self.clock() - start < limit:
                line += self.port.read_until(b"\n", _LONGEST_LINE)
        except (OSError, serial.SerialException) as error:
            raise _failed(data, error) from None
        if not line.endswith(b"\n"):
            raise SilenceError(
                f"sent {data!r} and got {line!r}; is the robot on, and at {self._baud} baud?",
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
                if self.clock() - start > _BABBLE:
                    raise GarbageError(
                        f"bytes have not stopped coming for {_BABBLE} s, the last ones"
                        f" {came[-20:]!r}; is this an e-puck's port, at {self._baud} baud?",
                        _FLUSH,
                        came,
                    )
                came = bytes(self.port.read(256))
                self.reset_seen = self.reset_seen or _WELCOME in came
        except (OSError, serial.SerialException) as error:
            raise _failed(_FLUSH, error) from None

    def pause(self, seconds: float) -> None:
        """Let time pass on the port's clock; what comes meanwhile is dropped."""
        end = self.clock() + seconds
        while self.emulated and self.clock() < end:
            self.port.read()
        if not self.emulated:
            time.sleep(seconds)

    def close(self) -> None:
        """Close the port, as far as it still can be."""
        with suppress(OSError, serial.SerialException):  # a device that has gone
            self.port.close()

    @property
    def _baud(self) -> int:
        return int(self.port.baudrate or 9600)

    def _read(self, row: bytes, size: int) -> bytes:
        start = self.clock()
        limit = PATIENCE + (len(row) + size) * _BITS / self._baud
        data = bytes(self.port.read(size))
        while len(data) < size and self.clock() - start < limit:
            data += self.port.read(size - len(data))
        if _WELCOME in data:
            self.reset_seen = True
            raise RobotResetError(
                f"sent {row!r} and got {data!r}: the robot has started again; is its battery low?",
                row,
                data,
            )
        if len(data) < size:
            raise SilenceError(
                f"sent {row!r} and got {len(data)} of {size} bytes within {limit:.2f} s; is the"
                f" robot on, and at {self._baud} baud?",
                row,
                data,
            )
        return data


def _failed(data: bytes, error: Exception) -> LinkError:
    return LinkError(
        f"sent {data!r}, then the serial port failed: {error}; is the cable in and the robot on?",
        data,
    )
