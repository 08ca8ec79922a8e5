"""The main job in one go: emulator, training, three live drives, a table and a picture.

The emulator is a process of its own with a real pseudo-terminal; the controller reaches it over
the serial line, and over Zenoh for camera, ground truth and reset.
"""

import selectors
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from macor_hil.bench import Bench, ZenohBench
from macor_hil.errors import BenchError, MacorError
from macor_hil.service import ServiceConfig, serve
from macor_hil.telemetry.schemas import Decision
from macor_hil.telemetry.session import open_session
from macor_hil.trials import Trial
from protocol.side_channel import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT, Outline, Pose, Reset

DEFAULT_SEED = 5
"""Robot and training that are shown; the README says over how many seeds the result holds."""

PLANNERS_SHOWN = ("graded", "anticipative", "reactive")
"""The planner beyond the paper, the paper's own, and the reactive system."""

_START_PATIENCE = 20.0
_STOP_PATIENCE = 5.0


@dataclass(frozen=True, slots=True)
class DemoSettings:
    """Where the demonstration runs.

    Attributes:
        map_file: what has been learned.
        link: name of the emulator's terminal.
        arena: where the robot drives.
        seed: of the emulated robot, which the map was trained on, and of the drives.
        speed: how many times faster than a real robot.
        emulator: Zenoh endpoint of the emulator.
        controller: Zenoh endpoint of the controller.
    """

    map_file: Path
    link: Path
    arena: str = "corridor"
    seed: int = DEFAULT_SEED
    speed: float = 1.0
    emulator: str = DEFAULT_ENDPOINT
    controller: str = CONTROLLER_ENDPOINT

    @property
    def training_port(self) -> str:
        """Port of the same robot for training in virtual time."""
        return f"khepera://{self.arena}?seed={self.seed}"


@dataclass(frozen=True, slots=True)
class DemoResult:
    """What the demonstration showed: the arena, and a trial of each planner by name."""

    outline: Outline
    trials: dict[str, Trial]

    @property
    def as_expected(self) -> bool:
        """Whether the robot that plans got round the curve and the reactive one hit the wall.

        The paper's own planner is shown and not judged: on some maps it gets round, on others not.
        """
        planning, reactive = self.trials["graded"], self.trials["reactive"]
        return reactive.collided and not (planning.collided or planning.touched)


def run_demo(settings: DemoSettings, on_step: Callable[[str, Decision], None]) -> DemoResult:
    """Switch an emulated robot on and let each planner drive it live.

    Args:
        settings: where.
        on_step: hears each decision with the name of its planner.

    Raises:
        MacorError: emulator, port, camera or map cannot be used.
    """
    with (
        emulator_process(settings) as port,
        open_session([], [settings.emulator]) as session,
    ):
        bench = ZenohBench(session, "khepera")
        trials = {name: _drive(settings, port, name, bench, on_step) for name in PLANNERS_SHOWN}
        return DemoResult(bench.outline(), trials)


@contextmanager
def emulator_process(settings: DemoSettings) -> Iterator[str]:
    """An emulator daemon; gives the name of its serial port.

    Raises:
        BenchError: it did not start; the message holds what it said.
    """
    command = [sys.executable, "-m", "khepera_emulator.cli", "run"]
    command += ["--arena", settings.arena, "--seed", str(settings.seed)]
    command += ["--link", str(settings.link), "--speed", str(settings.speed)]
    command += ["--listen", settings.emulator]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            _await_line(process)
            yield str(settings.link)
        finally:
            process.terminate()
            try:
                process.wait(_STOP_PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()


def _await_line(process: subprocess.Popen[str]) -> None:
    assert process.stdout is not None
    assert process.stderr is not None
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        ready = selector.select(_START_PATIENCE)
    if ready and process.stdout.readline():
        return
    process.terminate()
    reason = process.stderr.read().strip() or f"silent for {_START_PATIENCE:.0f} s"
    raise BenchError(f"the emulator did not start: {reason}")


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

    config = ServiceConfig(
        port=port,
        map_file=settings.map_file,
        planner=planner,
        listen=(settings.controller,),
        connect=(settings.emulator,),
        seed=settings.seed,
    )
    report = serve(config, watch)
    if report.signal:
        raise MacorError(f"the drive was interrupted ({report.signal}); the robot stands")
    return Trial(tuple(reinforcement), report.collided, bench.truth().touched, tuple(path))
