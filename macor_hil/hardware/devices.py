"""A robot, its camera and, where it is emulated, its bench: opened and closed together."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import zenoh

from macor_hil.hardware.bench import Bench, PortBench, ZenohBench
from macor_hil.hardware.cameras import Camera, open_camera
from macor_hil.hardware.khepera import Khepera, open_port
from macor_hil.safety.interruption import unwind_on_signals


@dataclass(frozen=True, slots=True)
class Hardware:
    """What a controller drives and sees with.

    Attributes:
        robot: client of the serial line.
        camera: source of mirror images.
        bench: set-up and ground truth of an emulated robot; None for a physical one.
    """

    robot: Khepera
    camera: Camera
    bench: Bench | None


def is_embedded(port: str) -> bool:
    """Whether a port string means a robot inside this process."""
    return port.startswith("khepera://")


@contextmanager
def robot_of(port: str, baud: int = 9600) -> Iterator[Khepera]:
    """Open the robot at a port alone; on the way out it is stopped and the port closed.

    SIGTERM and SIGHUP no longer end the process without that.

    Raises:
        RobotError: it is not there or does not answer.
    """
    unwind_on_signals()
    # a robot in this process is gone with its port
    reopen = None if is_embedded(port) else lambda: open_port(port, baud)
    with Khepera(open_port(port, baud), reopen) as robot:
        robot.connect()
        yield robot


@contextmanager
def open_hardware(
    port: str,
    camera: str = "auto",
    *,
    baud: int = 9600,
    session: zenoh.Session | None = None,
    name: str = "khepera",
) -> Iterator[Hardware]:
    """Open port and camera; on the way out the robot is stopped and both are closed.

    Args:
        port: a device, or a pySerial URL such as `khepera://corridor?seed=1`.
        camera: see `macor_hil.hardware.cameras`; `auto` is the port's own camera for `khepera://`
            ports and the emulator's Zenoh key for others.
        baud: rate in bits a second.
        session: Zenoh session for the camera and the bench, where they are reached over it.
        name: the robot's name in Zenoh keys.

    Raises:
        RobotError, CameraError: something is not there or does not answer.
    """
    if camera == "auto":
        camera = "port" if is_embedded(port) else "zenoh"
    with ExitStack() as stack:
        robot = stack.enter_context(robot_of(port, baud))
        eyes = open_camera(camera, port=robot.port, session=session, robot=name)
        stack.callback(eyes.close)
        bench: Bench | None = None
        if is_embedded(port):
            bench = PortBench(robot.port)
        elif session is not None and camera.startswith("zenoh"):
            bench = ZenohBench(session, name)
        yield Hardware(robot, eyes, bench)
