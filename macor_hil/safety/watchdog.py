"""A limit in time to wheel speeds that a robot holds, whoever is kept from ending them.

A program that holds speeds may be stopped by a debugger, by a handler of somebody else's or by a
prompt, and looks on no longer. A thread of its own then stops the robot.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Timer
from typing import Any, Final

from khepera_protocol.serial.framing import LINE_END
from khepera_protocol.serial.messages import build_request
from serial import SerialException

_STOP: Final = b"?" + LINE_END + build_request("D", 0, 0).encode()
"""Spoils half a request, so that its end is not driven to, and stops."""


@contextmanager
def stopped_after(port: Any, seconds: float) -> Iterator[None]:
    """Send a robot a stop where what is done within takes longer than a time.

    The reply is nobody's: an exchange that goes on afterwards fails, and is repeated.

    Args:
        port: a pySerial port whose time is ours.
        seconds: the limit.
    """
    timer = Timer(seconds, _stop, [port])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _stop(port: Any) -> None:
    with suppress(OSError, SerialException):  # the line is gone: nothing is left to say on it
        port.write(_STOP)
