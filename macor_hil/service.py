"""The live loop: drive a robot by a map, tell the world, and leave the robot standing.

A Khepera has no watchdog: it does what it was last told for as long as its battery lasts. Every
way out of the loop therefore sends a stop and waits for its confirmation. Motor commands are
targets of the position controller, so even a controller that is killed leaves a robot that comes to
rest at the end of its last command.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import zenoh

from macor_hil.agent import Agent, Step
from macor_hil.brain import Brain
from macor_hil.cameras import Camera
from macor_hil.drive import COMMANDS, Driver, DriveSettings
from macor_hil.errors import MacorError, RobotError
from macor_hil.hardware import Hardware, is_embedded, open_hardware
from macor_hil.interruption import Interruption
from macor_hil.map_file import load_map
from macor_hil.odometry import integrate
from macor_hil.planners import PLANNERS
from macor_hil.planners.planner import Planner
from macor_hil.robot import Khepera
from macor_hil.telemetry.decisions import decision_of, learned_of, link_of
from macor_hil.telemetry.publisher import Publisher, WatchedCamera
from macor_hil.telemetry.schemas import Decision, Odometry, Phase, State
from macor_hil.telemetry.session import open_session
from macor_hil.trials import MAX_COMMANDS, drive
from protocol.side_channel import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT, Pose


@dataclass(frozen=True, slots=True)
class ServiceConfig:
    """What to drive, with what, and who may watch.

    Attributes:
        port: serial device or pySerial URL.
        map_file: what has been learned.
        camera: see `macor_hil.hardware.open_hardware`.
        baud: rate of the serial line, bits a second.
        planner: a name in `PLANNERS`.
        commands: commands after which the run ends.
        robot: its name in Zenoh keys.
        listen: Zenoh endpoints where watchers find the controller.
        connect: Zenoh endpoints of the emulator and other peers. With neither of them there is
            no Zenoh session at all.
        seed: of the random commands where the map knows of none.
        start: where odometry begins.
        drive: how commands are driven, and the wheels that odometry counts with.
    """

    port: str
    map_file: Path
    camera: str = "auto"
    baud: int = 9600
    planner: str = "anticipative"
    commands: int = MAX_COMMANDS
    robot: str = "khepera"
    listen: tuple[str, ...] = (CONTROLLER_ENDPOINT,)
    connect: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    seed: int = 1
    start: Pose = field(default_factory=lambda: Pose(x=0.0, y=0.0, heading=0.0))
    drive: DriveSettings = field(default_factory=DriveSettings)


class Ending(StrEnum):
    """Why a run ended, where nothing failed."""

    COMMANDS = "all commands driven"
    COLLISION = "collision"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, slots=True)
class RunReport:
    """What came of a run.

    Attributes:
        ending: why it ended.
        commands: how many were driven, a colliding one included.
        reinforcement: their sum.
        signal: name of the signal that interrupted it, empty otherwise.
    """

    ending: Ending
    commands: int
    reinforcement: float
    signal: str = ""

    @property
    def collided(self) -> bool:
        """Whether a collision ended the run."""
        return self.ending is Ending.COLLISION


OnStep = Callable[[Decision], None]


def serve(config: ServiceConfig, on_step: OnStep | None = None) -> RunReport:
    """Drive until a collision, the last command, or a signal; the robot stands afterwards.

    SIGINT, SIGTERM and SIGHUP are taken over meanwhile and end the run.

    Args:
        config: what to drive.
        on_step: hears every decision when its outcome is known.

    Raises:
        MacorError: map, planner, Zenoh session, robot or camera cannot be used, or failed. If
            the robot could not be stopped, the message says so.
    """
    brain, _ = load_map(config.map_file)
    if not brain.art.size:
        raise MacorError(f"the map {config.map_file} holds no situations; train it first")
    planner = find_planner(config.planner)
    with Interruption() as interruption, _telemetry(config) as (session, publisher):
        run = _Run(config, publisher, on_step, interruption)
        with run:
            run.ending = _drive_hardware(run, brain, planner, session)
        return RunReport(run.ending, run.driven, run.total, interruption.name)


def find_planner(name: str) -> Planner:
    """A new planner by its name.

    Raises:
        MacorError: there is none of this name.
    """
    if name not in PLANNERS:
        raise MacorError(f"there is no planner {name!r}; there are {', '.join(PLANNERS)}")
    return PLANNERS[name]()


def _drive_hardware(
    run: "_Run", brain: Brain, planner: Planner, session: zenoh.Session | None
) -> Ending:
    config = run.config
    try:
        with (
            open_hardware(
                config.port, config.camera, baud=config.baud, session=session, name=config.robot
            ) as hardware,
            _Standstill(hardware.robot, run.interruption),
        ):
            return run.drive(hardware, brain, planner)
    except KeyboardInterrupt:
        return Ending.INTERRUPTED


@contextmanager
def _telemetry(config: ServiceConfig) -> Iterator[tuple[zenoh.Session | None, Publisher | None]]:
    with ExitStack() as stack:
        if not config.listen and not config.connect:
            yield None, None
            return
        session = stack.enter_context(open_session(config.listen, config.connect))
        yield session, stack.enter_context(Publisher(session, config.robot))


class _Standstill:
    """Leaves the robot standing, whatever happened; signals wait until it stands."""

    def __init__(self, robot: Khepera, interruption: Interruption) -> None:
        self._robot = robot
        self._interruption = interruption

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        _: type[BaseException] | None,
        error: BaseException | None,
        __: TracebackType | None,
    ) -> None:
        self._interruption.hold()
        try:
            self._robot.halt()
        except RobotError as failure:
            way = max(command.way for command in COMMANDS)
            first = str(error) if isinstance(error, RobotError) else str(failure)
            raise RobotError(
                f"{first}; the robot has NOT confirmed a stop: it may still drive to the end of"
                f" its last command, {1000 * way:.0f} mm at most"
            ) from error
        finally:
            self._interruption.release()


class _Run:
    """Counts and publishes what happens; as a context it says how the run ended.

    Attributes:
        config: what is driven.
        interruption: the signals.
        driven: commands so far.
        total: their reinforcement.
        ending: why it ended.
    """

    def __init__(
        self,
        config: ServiceConfig,
        publisher: Publisher | None,
        on_step: OnStep | None,
        interruption: Interruption,
    ) -> None:
        self.config = config
        self.interruption = interruption
        self.driven = 0
        self.total = 0.0
        self.ending = Ending.INTERRUPTED
        self._publisher = publisher
        self._on_step = on_step
        self._odometry = Odometry(pose=config.start, counters=(0, 0))
        # an embedded robot's clock begins when its port is opened
        self._time = 0.0 if is_embedded(config.port) else time.time()

    def __enter__(self) -> Self:
        self._say(Phase.STARTING)
        return self

    def __exit__(
        self,
        _: type[BaseException] | None,
        error: BaseException | None,
        __: TracebackType | None,
    ) -> None:
        if error is None:
            signal = f" by {self.interruption.name}" if self.interruption.name else ""
            self._say(Phase.STOPPED, f"{self.ending}{signal}")
        else:
            self._say(Phase.FAILED, str(error) or type(error).__name__)

    def drive(self, hardware: Hardware, brain: Brain, planner: Planner) -> Ending:
        """Drive to a collision or the last command.

        Raises:
            RobotError, CameraError: the hardware fails.
        """
        clock = hardware.robot.clock if is_embedded(self.config.port) else time.time
        agent = Agent(
            brain,
            Driver(hardware.robot, self.config.drive),
            self._watched(hardware.camera),
        )
        rng = np.random.default_rng(self.config.seed)
        self._time = clock()
        if self._publisher:
            self._publisher.learned(learned_of(brain), self._time)
        self._say(Phase.DRIVING)
        for step in drive(agent, planner, rng, self.config.commands):
            self._time = clock()
            self._count(step, brain)
            if self._publisher:
                self._publisher.link(link_of(hardware.robot.meter.read(), self._time))
            self.interruption.check()
            if step.outcome.collided:
                return Ending.COLLISION
        return Ending.COMMANDS

    def _watched(self, camera: Camera) -> Camera:
        return WatchedCamera(camera, self._publisher.frame) if self._publisher else camera

    def _count(self, step: Step, brain: Brain) -> None:
        self.total += step.reinforcement
        self._odometry = self._advance(step.outcome.counters)
        decision = decision_of(
            step,
            fields=brain.fields,
            time=self._time,
            sequence=self.driven,
            total_reinforcement=self.total,
            odometry=self._odometry,
        )
        self.driven += 1
        if self._publisher:
            self._publisher.decision(decision)
        self._say(Phase.DRIVING)
        if self._on_step:
            self._on_step(decision)

    def _advance(self, counters: tuple[int, int]) -> Odometry:
        pose = integrate(
            self._odometry.pose,
            self._odometry.counters,
            counters,
            pulse=self.config.drive.pulse,
            wheel_base=self.config.drive.wheel_base,
        )
        return Odometry(pose=pose, counters=counters)

    def _say(self, phase: Phase, reason: str = "") -> None:
        if self._publisher is None:
            return
        state = State(
            phase=phase,
            planner=self.config.planner,
            port=self.config.port,
            camera=self.config.camera,
            map=str(self.config.map_file),
            driven=self.driven,
            limit=self.config.commands,
            reason=reason,
        )
        self._publisher.state(state, self._time)
