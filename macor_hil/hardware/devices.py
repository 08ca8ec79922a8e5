"""A robot, its camera and, where it is emulated, its bench: opened and closed together."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

import zenoh

from macor_hil.hardware.address import PortAddress
from macor_hil.hardware.bench import Bench, PortBench, ZenohBench
from macor_hil.hardware.cameras import Camera
from macor_hil.hardware.cameras.catalogue import AUTO, CameraAddress
from macor_hil.hardware.khepera import Khepera, open_port
from macor_hil.safety.interruption import unwind_on_signals


@dataclass(frozen=True, slots=True)
class Hardware:
    """Devices that a controller drives and sees with.

    Attributes:
        address: of the serial port.
        robot: client of the serial line.
        camera: source of mirror images.
        bench: set-up and ground truth of an emulated robot; None for a physical one.
    """

    address: PortAddress
    robot: Khepera
    camera: Camera
    bench: Bench | None


@contextmanager
def robot_of(port: str | PortAddress, baud: int = 9600) -> Iterator[Khepera]:
    """Open the robot at a port alone; on the way out it is stopped and the port closed.

    SIGTERM and SIGHUP no longer end the process without that.

    Raises:
        RobotError: it is not there or does not answer.
    """
    unwind_on_signals()
    address = PortAddress.parse(port) if isinstance(port, str) else port

    def open_it() -> Any:
        return open_port(address, baud)

    # a robot in this process is gone with its port
    with Khepera(open_it(), None if address.embedded else open_it) as robot:
        robot.connect()
        yield robot


@contextmanager
def open_hardware(
    port: str,
    camera: str = AUTO,
    *,
    baud: int = 9600,
    session: zenoh.Session | None = None,
    name: str = "khepera",
) -> Iterator[Hardware]:
    """Open port and camera; on the way out the robot is stopped and both are closed.

    Args:
        port: a device, or a pySerial URL such as `khepera://corridor?seed=1`.
        camera: see `macor_hil.hardware.cameras.catalogue`.
        baud: rate in bits a second.
        session: Zenoh session for the camera and the bench, where they are reached over it.
        name: the robot's name in Zenoh keys.

    Raises:
        RobotError, CameraError: something is not there or does not answer.
    """
    address = PortAddress.parse(port)
    with ExitStack() as stack:
        robot = stack.enter_context(robot_of(address, baud))
        eyes = CameraAddress.parse(camera, address)  # afterwards: whatever fails, the robot stands
        opened = eyes.open(port=robot.port, session=session, robot=name)
        stack.callback(opened.close)
        bench: Bench | None = None
        if address.embedded:
            bench = PortBench(robot.port)
        elif session is not None and eyes.is_emulated:
            bench = ZenohBench(session, name)
        yield Hardware(address, robot, opened, bench)
