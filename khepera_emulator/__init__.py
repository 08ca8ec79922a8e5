"""A Khepera robot in software: its serial line, its body, its sensors and a camera on its back.

Importing this package registers the URL scheme `khepera://` with pySerial, so that any pySerial
program can open a whole robot: `serial.serial_for_url("khepera://corridor?seed=1")`. Nothing
else happens at import. `start` switches on a robot in a process of its own, for tests.
"""

from importlib import import_module
from typing import TYPE_CHECKING

import serial

if TYPE_CHECKING:
    from khepera_emulator.app.testing.started import StartedRobot, start
    from khepera_emulator.errors import EmulatorError

__all__ = ["EmulatorError", "StartedRobot", "start"]

_PORTS = "khepera_emulator.ports"

if _PORTS not in serial.protocol_handler_packages:
    serial.protocol_handler_packages.append(_PORTS)

_PLACES = {
    "EmulatorError": "khepera_emulator.errors",
    "StartedRobot": "khepera_emulator.app.testing.started",
    "start": "khepera_emulator.app.testing.started",
}


def __getattr__(name: str) -> object:
    """Import what the package offers when it is asked for; read `__version__` likewise."""
    if name == "__version__":
        from khepera_protocol.version import installed_version

        return installed_version()
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found: object = getattr(import_module(_PLACES[name]), name)
    return found
