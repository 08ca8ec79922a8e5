"""What several commands have in common: their options, the hardware they open, how they report."""

import os
import select
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated, Final

import typer
from khepera_protocol.extras import how_to_install
from khepera_protocol.zenoh.controller_payloads import Decision
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)

from macor_hil.errors import MacorError
from macor_hil.hardware.cameras import Camera, open_camera
from macor_hil.hardware.devices import Hardware, is_embedded, open_hardware
from macor_hil.hardware.line import open_port
from macor_hil.runs.demo import DEFAULT_SEED
from macor_hil.telemetry.session import open_session

COLUMNS = (
    TextColumn("{task.description}"),
    BarColumn(),
    MofNCompleteColumn(),
    TimeRemainingColumn(),
)

_INPUT: Final = 0
_LOOK: Final = 100
"""Milliseconds between two looks for a signal."""

DEFAULT_PORT = f"khepera://corridor?seed={DEFAULT_SEED}"
DEFAULT_MAP = Path("runs/corridor.npz")

PortOption = Annotated[
    str, typer.Option(help="Serial device or pySerial URL; khepera://ARENA is a robot in-process.")
]
CameraOption = Annotated[
    str,
    typer.Option(help="auto, port, zenoh\\[:KEY], video:DEVICE, video:FILE or images:FOLDER."),
]
BaudOption = Annotated[int, typer.Option(min=1200, help="Rate of the serial line, bits a second.")]
MapOption = Annotated[Path, typer.Option("--map", help="Map file.")]
RobotOption = Annotated[str, typer.Option(metavar="NAME", help="The robot's name in Zenoh keys.")]
ConnectOption = Annotated[
    list[str], typer.Option(metavar="ENDPOINT", help="Zenoh peers, there now or later.")
]
ZenohConfigOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Zenoh's own configuration (JSON5), for routers, TLS and access control; --listen and"
        " --connect then do not count. Examples: docs/zenoh.",
    ),
]
ProfileOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="What was measured on this robot: its wheels, its camera's mirror."
    ),
]
SpeedOption = Annotated[
    int,
    typer.Option(min=1, max=127, help="Greatest speed of a wheel, counts / 10 ms (8 mm/s each)."),
]
InfraredOption = Annotated[
    int,
    typer.Option(
        min=1,
        max=1023,
        help="Proximity reading from which on the robot stops: it counts as touching.",
    ),
]
SeedOption = Annotated[int, typer.Option(min=0, help="Seed of all random choices.")]


def decision_line(decision: Decision) -> str:
    """One line for a decision: what was seen, weighed and done."""
    values = "  ".join(
        f"{a.command} {'  -  ' if a.evaluation is None else f'{a.evaluation:5.2f}'}"
        for a in decision.alternatives
    )
    end = "  COLLISION" if decision.collided else ""
    return (
        f"{decision.sequence:3}  situation {decision.situation.node:2}  {values}"
        f"  -> {decision.command:8}  r {decision.reinforcement:.2f}{end}"
    )


@contextmanager
def hardware_of(
    port: str,
    camera: str,
    baud: int,
    robot: str,
    connect: list[str],
    zenoh_config: Path | None = None,
) -> Iterator[Hardware]:
    """The hardware, with a Zenoh session where camera or bench are reached over one."""
    with ExitStack() as stack:
        session = None
        if camera.startswith("zenoh") or (camera == "auto" and not is_embedded(port)):
            session = stack.enter_context(open_session([], connect, zenoh_config))
        yield stack.enter_context(
            open_hardware(port, camera, baud=baud, session=session, name=robot)
        )


@contextmanager
def camera_of(
    port: str, camera: str, robot: str, connect: list[str], zenoh_config: Path | None = None
) -> Iterator[Camera]:
    """A camera alone; of the robot at the port only where the port has one of its own."""
    if camera == "auto":
        camera = "port" if is_embedded(port) else "zenoh"
    with ExitStack() as stack:
        session = opened = None
        if camera.startswith("zenoh"):
            session = stack.enter_context(open_session([], connect, zenoh_config))
        if camera == "port":
            opened = open_port(port)
            stack.callback(opened.close)
        eyes = open_camera(camera, port=opened, session=session, robot=robot)
        stack.callback(eyes.close)
        yield eyes


@contextmanager
def extra(name: str) -> Iterator[None]:
    """What is imported here comes with an extra.

    Raises:
        MacorError: it is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise MacorError(
            f"{error.name} is not installed; install the extra {name!r} with:"
            f" {how_to_install(name)}"
        ) from None


@contextmanager
def shown(hardware: Hardware, robot: str, listen: list[str]) -> Iterator[Callable[[], None]]:
    """Let watchers see arena and robot of a `khepera://` port; call again and again to tell them.

    Raises:
        MacorError: an endpoint cannot be had.
    """
    if not listen:
        yield lambda: None
        return
    port = hardware.robot.port
    from khepera_emulator.app.side_channel import SideChannel
    from khepera_emulator.errors import EmulatorError

    with ExitStack() as stack:
        try:
            channel = stack.enter_context(SideChannel(robot, listen, looking=True))
        except EmulatorError as error:
            raise MacorError(str(error)) from None

        def show() -> None:
            if channel.delay() <= 0.0:
                channel.serve(port.emulator)

        yield show


class Bar:
    """A progress bar; call it with the number of commands driven so far."""

    def __init__(self, progress: Progress, task: TaskID) -> None:
        self._progress = progress
        self._task = task

    def __call__(self, done: int) -> None:
        """Show how many are done."""
        self._progress.update(self._task, completed=done)

    def say(self, line: str) -> None:
        """Print a line above the bar."""
        self._progress.console.print(line, markup=False, highlight=False)

    def ask(self, question: str) -> str:
        """Ask, while the bar is away, and give the answer.

        Raises:
            MacorError: nobody can answer.
        """
        self._progress.stop()
        try:
            typer.echo(f"{question}: ", nl=False)
            return _read_line()
        finally:
            self._progress.start()


def _read_line() -> str:
    """Read a line from the standard input.

    A signal that comes just before a read that blocks would wait for the line: so none blocks for
    long.

    Raises:
        MacorError: the input has ended.
    """
    poll = select.poll()
    poll.register(_INPUT, select.POLLIN)
    line = b""
    while not line.endswith(b"\n"):
        if not poll.poll(_LOOK):
            continue
        byte = os.read(_INPUT, 1)
        if not byte:
            raise MacorError(
                "the standard input ended before this was answered; start it from a terminal"
            )
        line += byte
    return line.decode(errors="replace").strip()


@contextmanager
def progress_bar(total: int) -> Iterator[Bar]:
    """Show a progress bar on the standard error output."""
    with Progress(*COLUMNS, console=Console(stderr=True)) as progress:
        yield Bar(progress, progress.add_task("driving", total=total))
