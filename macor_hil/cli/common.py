"""Functions that several commands share: hardware that they open, and progress that they show."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from math import inf
from typing import Final, NamedTuple

import typer
import zenoh
from khepera_protocol.extras import how_to_install
from khepera_protocol.system.waiting import input_waits
from khepera_protocol.zenoh.controller_payloads import Decision, State
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
from macor_hil.hardware.cameras import Camera, Frame
from macor_hil.hardware.devices import Hardware, hardware_at, robot_at
from macor_hil.hardware.line.serial_line import open_port
from macor_hil.hardware.options import DeviceOptions, ZenohOptions
from macor_hil.monitor.goals import goal_seen
from macor_hil.runs.options import TrainOptions
from macor_hil.telemetry.publisher import Publisher, PublishingCamera
from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.steady_clock import SteadyClock

COLUMNS = (
    TextColumn("{task.description}"),
    BarColumn(),
    MofNCompleteColumn(),
    TimeRemainingColumn(),
)

_INPUT: Final = 0
_TELL: Final = 0.25
"""Seconds between two words of a training's progress, or two of its pictures."""

_LOOK: Final = 0.1
"""Seconds between two looks for a signal."""


def decision_line(decision: Decision) -> str:
    """Return a line for a decision: what was seen, weighed and done."""
    values = "  ".join(
        f"{a.command} {'  -  ' if a.evaluation is None else f'{a.evaluation:5.2f}'}"
        for a in decision.alternatives
    )
    goal = f"  {goal_seen(decision.goal)}" if decision.goal else ""
    end = goal + ("  COLLISION" if decision.collided else "")
    return (
        f"{decision.sequence:3}  situation {decision.situation.node:2}  {values}"
        f"  -> {decision.command:8}  r {decision.reinforcement:.2f}{end}"
    )


@contextmanager
def hardware_of(options: DeviceOptions) -> Iterator[Hardware]:
    """Open the hardware, with a Zenoh session where camera or bench are reached over one."""
    with ExitStack() as stack:
        session = None
        if options.camera_address.needs_session:
            session = stack.enter_context(session_of(options))
        yield stack.enter_context(hardware_at(options, session))


@contextmanager
def camera_of(options: DeviceOptions) -> Iterator[Camera]:
    """Open a camera alone; with the robot's port only where the camera is the port's own."""
    address = options.camera_address
    with ExitStack() as stack:
        session = port = None
        if address.needs_session:
            session = stack.enter_context(session_of(options))
        client = stack.enter_context(robot_at(options)) if address.needs_client else None
        if address.needs_port:
            port = open_port(options.address, options.baud)
            stack.callback(port.close)
        eyes = address.open(port=port, client=client, session=session, robot=options.robot)
        stack.callback(eyes.close)
        yield eyes


def session_of(
    options: ZenohOptions, listen: Sequence[str] = ()
) -> AbstractContextManager[zenoh.Session]:
    """Open a Zenoh session to the peers of the options."""
    return open_session(listen, options.connect, options.zenoh_config)


@contextmanager
def extra(name: str) -> Iterator[None]:
    """Say how to install the extra that a module imported within comes with.

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


class Shown(NamedTuple):
    """A training that watchers see.

    Attributes:
        hardware: whose pictures they see, too.
        progress: a function to call after every command, with their number.
    """

    hardware: Hardware
    progress: Callable[[int], None]


@contextmanager
def shown(
    hardware: Hardware, options: TrainOptions, say: Callable[[int], State]
) -> Iterator[Shown]:
    """Let watchers see a training: progress and pictures, arena and robot of a `khepera://` port.

    Args:
        hardware: open.
        options: of the training.
        say: returns the state that watchers are told, after so many commands.

    Raises:
        MacorError: an endpoint cannot be had.
    """
    if not options.listen:
        yield Shown(hardware, lambda _: None)
        return
    with ExitStack() as stack:
        session, show = _seen(stack, hardware, options)
        publisher = stack.enter_context(Publisher(session, options.robot))
        clock, told, seen = SteadyClock(), Pace(_TELL), Pace(_TELL)

        def progress(done: int) -> None:
            show()
            if told.due() or done == options.schedule.commands:
                publisher.state(say(done), clock.seconds())

        def picture(frame: Frame) -> None:
            if seen.due():
                publisher.frame(frame)

        eyes = PublishingCamera(hardware.camera, picture)
        yield Shown(replace(hardware, camera=eyes), progress)


class Pace:
    """Something that happens once in a while at most.

    Args:
        seconds: between two times.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._last = -inf

    def due(self) -> bool:
        """Return whether it is time again; if so, the while begins anew."""
        now = time.monotonic()
        if now - self._last < self._seconds:
            return False
        self._last = now
        return True


def _seen(
    stack: ExitStack, hardware: Hardware, options: TrainOptions
) -> tuple[zenoh.Session, Callable[[], None]]:
    """Open a session for watchers; an emulated robot in this process is shown in it, too."""
    if not options.address.embedded:
        return stack.enter_context(open_session(options.listen, ())), lambda: None
    port = hardware.robot.port
    from khepera_emulator.app.side_channel import SideChannel
    from khepera_emulator.errors import EmulatorError

    try:
        channel = stack.enter_context(
            SideChannel(options.robot, list(options.listen), looking=True)
        )
    except EmulatorError as error:
        raise MacorError(str(error)) from None

    def show() -> None:
        if channel.delay() <= 0.0:
            channel.serve(port.emulator)

    return channel.session, show


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
        """Ask a question while the bar is away, and return the answer.

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
    line = b""
    while not line.endswith(b"\n"):
        if not input_waits(_INPUT, _LOOK):
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
