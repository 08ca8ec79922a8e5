"""A robot, its camera and, where it is emulated, its bench: opened and closed together."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any, Final

import zenoh
from khepera_protocol.epuck.wifi import WIFI

from macor_hil.errors import GarbageError
from macor_hil.hardware.address import PortAddress
from macor_hil.hardware.bench import Bench, PortBench, ZenohBench
from macor_hil.hardware.cameras import Camera
from macor_hil.hardware.cameras.catalogue import AUTO, CameraAddress
from macor_hil.hardware.khepera import Khepera
from macor_hil.hardware.line.serial_line import open_port
from macor_hil.hardware.options import DeviceOptions, LineOptions
from macor_hil.hardware.robots.epuck.client import Epuck
from macor_hil.hardware.robots.epuck.wifi import WifiEpuck
from macor_hil.hardware.robots.robot import Robot, RobotKind
from macor_hil.safety.interruption import unwind_on_signals

_CLIENTS: Final = {RobotKind.KHEPERA: Khepera, RobotKind.EPUCK: Epuck}

_EPUCK_TO_VERSIONS: Final = b"b\r\n"
"""An e-puck's answer to a Khepera's request for versions, which it takes for that of a lamp."""


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
    robot: Robot
    camera: Camera
    bench: Bench | None


@contextmanager
def robot_of(
    port: str | PortAddress, baud: int = 9600, kind: RobotKind = RobotKind.AUTO
) -> Iterator[Robot]:
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
    reopen = None if address.embedded else open_it
    if kind is RobotKind.AUTO:
        opened = open_it()
        if address.embedded:
            kind = RobotKind(opened.emulator.setup.model.kind)
        elif address.on_wifi:
            kind = RobotKind.EPUCK
        else:
            with Khepera(opened, reopen) as robot:
                if not _is_epuck(robot):
                    yield robot
                    return
            kind, opened = RobotKind.EPUCK, open_it()
    else:
        opened = open_it()
    packets = address.on_wifi or (address.embedded and opened.emulator.uart.dialect.name == WIFI)
    client: Callable[..., Any] = WifiEpuck if packets else _CLIENTS[kind]
    with client(opened, reopen) as robot:
        robot.connect()
        yield robot


def robot_at(options: LineOptions) -> AbstractContextManager[Robot]:
    """Open the robot that options name; see `robot_of`."""
    return robot_of(options.address, options.baud, options.robot_kind)


def _is_epuck(robot: Khepera) -> bool:
    """Connect to a Khepera; returns True if an e-puck has answered.

    Raises:
        RobotError: nothing answers like either.
    """
    try:
        robot.connect()
    except GarbageError as error:
        if error.came == _EPUCK_TO_VERSIONS:
            return True
        raise
    return False


@contextmanager
def open_hardware(
    port: str,
    camera: str = AUTO,
    *,
    baud: int = 9600,
    kind: RobotKind = RobotKind.AUTO,
    session: zenoh.Session | None = None,
    name: str = "khepera",
) -> Iterator[Hardware]:
    """Open port and camera; on the way out the robot is stopped and both are closed.

    Args:
        port: a device, or a pySerial URL such as `khepera://corridor?seed=1`.
        camera: see `macor_hil.hardware.cameras.catalogue`.
        baud: rate in bits a second.
        kind: of robot; AUTO: whichever answers.
        session: Zenoh session for the camera and the bench, where they are reached over it.
        name: the robot's name in Zenoh keys.

    Raises:
        RobotError, CameraError: something is not there or does not answer.
    """
    address = PortAddress.parse(port)
    with ExitStack() as stack:
        robot = stack.enter_context(robot_of(address, baud, kind))
        eyes = CameraAddress.parse(camera, address)  # afterwards: whatever fails, the robot stands
        opened = eyes.open(port=robot.port, client=robot, session=session, robot=name)
        stack.callback(opened.close)
        bench: Bench | None = None
        if address.embedded:
            bench = PortBench(robot.port)
        elif session is not None and eyes.is_emulated:
            bench = ZenohBench(session, name)
        yield Hardware(address, robot, opened, bench)


def hardware_at(
    options: DeviceOptions, session: zenoh.Session | None
) -> AbstractContextManager[Hardware]:
    """Open the hardware that options name; see `open_hardware`."""
    return open_hardware(
        options.port,
        options.camera,
        baud=options.baud,
        kind=options.robot_kind,
        session=session,
        name=options.robot,
    )
