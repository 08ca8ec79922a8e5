"""Robots inside the test's own process, as pySerial gives them, with their own type."""

from typing import Any

import serial

import khepera_emulator  # noqa: F401 - registers khepera://
from khepera_emulator.ports.protocol_khepera import Serial


def open_robot(url: str, **settings: Any) -> Serial:
    """Open a `khepera://` URL by pySerial's look-up."""
    port = serial.serial_for_url(url, **settings)
    assert isinstance(port, Serial)
    return port
