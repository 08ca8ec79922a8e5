"""The main job in one go: emulator, training, four live drives, a table and pictures.

The emulator is a process of its own with a real pseudo-terminal; the controller reaches it over
the serial line, and over Zenoh for camera, ground truth and reset.
"""

import os
import selectors
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

from khepera_protocol.text import printable
from khepera_protocol.zenoh.config import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT
from khepera_protocol.zenoh.controller_payloads import Decision
from khepera_protocol.zenoh.payloads import Outline, Pose, Reset

from macor_hil.errors import BenchError, MacorError
from macor_hil.hardware.address import DEFAULT_SEED
from macor_hil.hardware.bench import Bench, ZenohBench
from macor_hil.mind.map_file import load_map
from macor_hil.runs.live_run import serve
from macor_hil.runs.options import RunOptions
from macor_hil.runs.trials import Trial
from macor_hil.telemetry.session import open_session

PLANNERS_SHOWN = ("graded", "anticipative", "reactive")
"""The planner beyond the paper, the paper's own, and the reactive system."""

HARDER = "maze"
"""Arena in which nothing was trained."""

PLANNER_IN_HARDER = "foresight"

_START_PATIENCE = 20.0
_STOP_PATIENCE = 5.0
_LAST_WORDS = 1000
"""Characters of what an emulator said last."""


@dataclass(frozen=True, slots=True)
class DemoSettings:
    """Settings of the demonstration.

    Attributes:
        map_file: what has been learned.
        speed: how many times faster than a real robot.
        arena: where the robot drives.
        seed: of the emulated robot, which the map was trained on, and of the drives.
        emulator: Zenoh endpoint of the emulator.
        controller: Zenoh endpoint of the controller.
    """

    map_file: Path
    speed: float = 1.0
    arena: str = "corridor"
    seed: int = DEFAULT_SEED
    emulator: str = DEFAULT_ENDPOINT
    controller: str = CONTROLLER_ENDPOINT

    @property
    def training_port(self) -> str:
        """Port of the same robot for training in virtual time."""
        return f"khepera://{self.arena}?seed={self.seed}"

    @property
    def watching(self) -> str:
        """Options that lead a watcher here; none where it looks by itself."""
        if (self.controller, self.emulator) == (CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT):
            return ""
        return f" --connect {self.controller} --connect {self.emulator}"


@contextmanager
def reserved(usual: str) -> Iterator[str]:
    """Keep an endpoint on this machine for whoever listens there within the context.

    It has another port than the usual one where that is in use, or was a minute ago.
    """
    host, _, port = usual.removeprefix("tcp/").rpartition(":")
    with socket.socket() as held:
        try:
            held.bind((host, int(port)))
        except OSError:
            held.bind((host, 0))
        # it does not listen, and whoever says the same may bind it, too: Zenoh, but no other demo
        held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        yield f"tcp/{host}:{held.getsockname()[1]}"


@dataclass(frozen=True, slots=True)
class DemoResult:
    """Result of the demonstration.

    Attributes:
        outline: the arena of the training.
        trials: a trial of each planner there, by name.
        harder: the other arena, and a trial there; None: the map is of a time before its planner.
    """

    outline: Outline
    trials: dict[str, Trial]
    harder: tuple[Outline, Trial] | None = None

    @property
    def as_expected(self) -> bool:
        """True if the robots that plan drove to the end and the reactive one hit the wall.

        The paper's own planner is shown and not judged: on some maps it gets round, on others not.
        """
        planning, reactive = [self.trials["graded"]], self.trials["reactive"]
        if self.harder is not None:
            planning.append(self.harder[1])
        return reactive.collided and not any(each.collided or each.touched for each in planning)


def run_demo(settings: DemoSettings, on_step: Callable[[str, Decision], None]) -> DemoResult:
    """Switch an emulated robot on and let each planner drive it live; the last one in a maze.

    Args:
        settings: where.
        on_step: hears each decision with the name of its planner.

    Raises:
        MacorError: emulator, port, camera or map cannot be used.
    """
    outline, trials = _driven(settings, PLANNERS_SHOWN, on_step)
    if PLANNER_IN_HARDER not in load_map(settings.map_file)[0].memories:
        return DemoResult(outline, trials)
    there = replace(settings, arena=HARDER)
    maze, driven = _driven(there, (PLANNER_IN_HARDER,), on_step)
    return DemoResult(outline, trials, (maze, driven[PLANNER_IN_HARDER]))


def _driven(
    settings: DemoSettings, planners: Sequence[str], on_step: Callable[[str, Decision], None]
) -> tuple[Outline, dict[str, Trial]]:
    with (
        emulator_process(settings) as port,
        open_session([], [settings.emulator]) as session,
    ):
        bench = ZenohBench(session, "khepera")
        trials = {name: _drive(settings, port, name, bench, on_step) for name in planners}
        return bench.outline(), trials


@contextmanager
def emulator_process(settings: DemoSettings) -> Iterator[str]:
    """Run an emulator daemon; gives the name of its serial port.

    Raises:
        BenchError: it did not start, or has ended; the message holds what it said.
    """
    command = [sys.executable, "-m", "khepera_emulator.app.cli", "run"]
    command += ["--arena", settings.arena, "--seed", str(settings.seed)]
    command += ["--speed", str(settings.speed), "--listen", settings.emulator]
    with (
        TemporaryFile() as said,  # which takes any number of warnings, as a pipe does not
        subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=said,
            # Ctrl-C ends the controller, which stops the robot, and only then the emulator
            process_group=0,
        ) as process,
    ):
        try:
            yield _announced_port(process, said)
        except MacorError as error:
            if process.poll() is None or isinstance(error, BenchError):
                raise
            raise BenchError(f"the emulator has ended: {_last_words(said)}") from error
        finally:
            process.terminate()
            try:
                process.wait(_STOP_PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()


def _announced_port(process: subprocess.Popen[bytes], said: IO[bytes]) -> str:
    """Wait for the line that an emulator says when it has started: `NAME on PORT`."""
    assert process.stdout is not None
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        ready = selector.select(_START_PATIENCE)
    line = process.stdout.readline() if ready else b""
    if not line:
        reason = _last_words(said) if ready else f"silent for {_START_PATIENCE:.0f} s"
        raise BenchError(f"the emulator did not start: {reason}")
    return line.decode().strip().partition(" on ")[2]


def _last_words(said: IO[bytes]) -> str:
    said.seek(max(0, said.seek(0, os.SEEK_END) - _LAST_WORDS))
    lines = said.read().strip().splitlines()
    return printable(lines[-1]) if lines else "it said nothing"


def _drive(
    settings: DemoSettings,
    port: str,
    planner: str,
    bench: Bench,
    on_step: Callable[[str, Decision], None],
) -> Trial:
    truth = bench.reset(Reset(seed=settings.seed))
    path: list[Pose] = [truth.pose]
    reinforcement: list[float] = []

    def watch(decision: Decision) -> None:
        path.append(bench.truth().pose)
        reinforcement.append(decision.reinforcement)
        on_step(planner, decision)

    options = RunOptions(
        port=port,
        map_file=settings.map_file,
        planner=planner,
        listen=(settings.controller,),
        connect=(settings.emulator,),
        seed=settings.seed,
    )
    report = serve(options, watch)
    if report.signal:
        raise KeyboardInterrupt
    return Trial(tuple(reinforcement), report.collided, bench.truth().touched, tuple(path))
