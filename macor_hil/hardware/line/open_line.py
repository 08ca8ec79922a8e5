"""An open serial port with a robot at its other end, whatever the robot speaks."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

import serial

from macor_hil.errors import LinkError, RobotResetError

QUIET: Final = 0.05
"""Seconds without a byte after which nothing more is taken to be on its way."""

BABBLE: Final = 1.0
"""Seconds for which bytes that nobody asked for are waited out."""

PORT_ERRORS: Final = (OSError, serial.SerialException)
"""Errors of a port that has failed."""


class OpenLine(ABC):
    """A line to a robot; what goes over it is the affair of its kind.

    Attributes:
        port: the pySerial port.
        clock: seconds on the clock that the port lives by: virtual for `khepera://`, else real.
        reset_seen: whether a robot that starts has been heard since this was last set to False.
    """

    def __init__(self, port: Any) -> None:
        self.port = port
        self._emulated = hasattr(port, "now")
        self.clock: Callable[[], float] = (lambda: port.now) if self._emulated else time.monotonic
        self.reset_seen = False
        # one time-out for good: to change it costs a remote port a negotiation
        if port.timeout != QUIET:
            port.timeout = QUIET

    @property
    def baud(self) -> int:
        """Rate in bits a second."""
        return int(self.port.baudrate or 9600)

    @abstractmethod
    def clear(self, data: bytes = b"") -> None:
        """End a half-sent request, send bytes, and drop what comes until it is quiet.

        Raises:
            LinkError: the port failed.
            GarbageError: what is on it never pauses.
        """

    def pause(self, seconds: float) -> None:
        """Let time pass on the port's clock; what comes meanwhile is dropped."""
        end = self.clock() + seconds
        while self._emulated and self.clock() < end:
            self.port.read()
        if not self._emulated:
            time.sleep(seconds)

    def close(self) -> None:
        """Close the port, as far as it still can be."""
        with suppress(*PORT_ERRORS):  # a device that has gone
            self.port.close()

    def restarted(self, sent: bytes, came: bytes) -> RobotResetError:
        """Note that the robot has started again; returns the error that says so."""
        self.reset_seen = True
        return RobotResetError(
            f"sent {sent!r} and got {came!r}: the robot has started again; is its battery low?",
            sent,
            came,
        )


def port_failed(sent: bytes, error: Exception) -> LinkError:
    """Return the error of a line whose port failed after these bytes."""
    return LinkError(
        f"sent {sent!r}, then the serial port failed: {error}; is the cable in and the robot on?",
        sent,
    )
