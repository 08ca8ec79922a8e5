"""A Khepera robot in software: its serial line, its body, its sensors and a camera on its back.

Importing this package registers the URL scheme `khepera://` with pySerial, so that any pySerial
program can open a whole robot: `serial.serial_for_url("khepera://corridor?seed=1")`. Nothing
else happens at import.
"""

import serial

_PORTS = "khepera_emulator.ports"

if _PORTS not in serial.protocol_handler_packages:
    serial.protocol_handler_packages.append(_PORTS)
