"""What several commands have in common: their options, the hardware they open, how they report."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)

from macor_hil.demo import DEFAULT_SEED
from macor_hil.hardware import Hardware, is_embedded, open_hardware
from macor_hil.telemetry.schemas import Decision
from macor_hil.telemetry.session import open_session

COLUMNS = (
    TextColumn("{task.description}"),
    BarColumn(),
    MofNCompleteColumn(),
    TimeRemainingColumn(),
)

DEFAULT_PORT = f"khepera://corridor?seed={DEFAULT_SEED}"
DEFAULT_MAP = Path("runs/corridor.npz")

PortOption = Annotated[
    str, typer.Option(help="Serial device or pySerial URL; khepera://ARENA is a robot in-process.")
]
CameraOption = Annotated[
    str, typer.Option(help="auto, port, zenoh\\[:KEY], video:DEVICE or video:FILE.")
]
BaudOption = Annotated[int, typer.Option(min=1, help="Rate of the serial line, bits a second.")]
MapOption = Annotated[Path, typer.Option("--map", help="Map file.")]
RobotOption = Annotated[str, typer.Option(metavar="NAME", help="The robot's name in Zenoh keys.")]
ConnectOption = Annotated[
    list[str], typer.Option(metavar="ENDPOINT", help="Zenoh peers, there now or later.")
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
    port: str, camera: str, baud: int, robot: str, connect: list[str]
) -> Iterator[Hardware]:
    """The hardware, with a Zenoh session where camera or bench are reached over one."""
    with ExitStack() as stack:
        session = None
        if camera.startswith("zenoh") or (camera == "auto" and not is_embedded(port)):
            session = stack.enter_context(open_session([], connect))
        yield stack.enter_context(
            open_hardware(port, camera, baud=baud, session=session, name=robot)
        )


@contextmanager
def progress_bar(total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar; call with the number of commands driven so far."""
    with Progress(*COLUMNS, console=Console(stderr=True)) as bar:
        task = bar.add_task("driving", total=total)
        yield lambda done: bar.update(task, completed=done)
