"""One live run: drives by a map, counts, publishes, and gets over failures of robot and camera."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from khepera_protocol.validation import first_fault
from khepera_protocol.zenoh.controller_payloads import (
    Decision,
    Odometry,
    Phase,
    State,
)
from khepera_protocol.zenoh.payload_model import MOST_TEXT
from pydantic import ValidationError

from macor_hil.errors import CameraError, MacorError, RobotError
from macor_hil.hardware.cameras import Camera
from macor_hil.hardware.cameras.checks import CheckedCamera, is_hopeless, limits_of
from macor_hil.hardware.cameras.watchdog import CameraWatch
from macor_hil.hardware.devices import Hardware, is_embedded
from macor_hil.hardware.driver import LONGEST_WAY, Driver, DriveSettings, all_of
from macor_hil.hardware.khepera import Khepera
from macor_hil.hardware.odometry import integrate
from macor_hil.hardware.standstill import standing_on_failure
from macor_hil.mind.brain import Brain
from macor_hil.mind.experience import Moment
from macor_hil.mind.planners.planner import Plan, Planner
from macor_hil.runs.agent import Agent, Step
from macor_hil.runs.decision_samples import decision_of, learned_of, link_of
from macor_hil.runs.service_config import Ending, ServiceConfig
from macor_hil.runs.trials import drive
from macor_hil.safety.interruption import Interruption
from macor_hil.safety.late_bell import LateBell
from macor_hil.telemetry.publisher import Publisher, PublishingCamera
from macor_hil.telemetry.steady_clock import SteadyClock

_log = logging.getLogger(__name__)

OnStep = Callable[[Decision], None]

_SLICE: Final = 1.0
"""Seconds of waiting for the robot between two looks at whether the run is to end."""

_IN_A_ROW: Final = 5
"""Failures without a command between them after which a run gives up."""

_PAUSE: Final = 0.2


class LiveRun:
    """Drives, counts and publishes; as a context it says how the run ended.

    Args:
        config: what is driven.
        drive: how.
        publisher: who tells the world, or None.
        on_step: hears every decision when its outcome is known.
        interruption: what may end the run.

    Attributes:
        driven: commands so far.
        total: their reinforcement.
        recoveries: failures that the run got over.
        ending: why it ended.
    """

    def __init__(
        self,
        config: ServiceConfig,
        drive: DriveSettings,
        publisher: Publisher | None,
        on_step: OnStep | None,
        interruption: Interruption,
    ) -> None:
        self.driven = 0
        self.total = 0.0
        self.recoveries = 0
        self.ending = Ending.INTERRUPTED
        self._config = config
        self._settings = drive
        self._publisher = publisher
        self._on_step = on_step
        self._interruption = interruption
        self._odometry = Odometry(pose=config.start, counters=(0, 0))
        self._in_a_row = 0
        # an embedded robot's clock begins when its port is opened
        self._clock: Callable[[], float] = SteadyClock().seconds
        self._time = 0.0 if is_embedded(config.port) else self._clock()

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
            signal = f" by {self._interruption.name}" if self._interruption.name else ""
            self._say(Phase.STOPPED, f"{self.ending}{signal}")
        else:
            self._say(Phase.FAILED, str(error) or type(error).__name__)

    def drive(self, hardware: Hardware, brain: Brain, planner: Planner) -> Ending:
        """Drive to a collision or the last command.

        Raises:
            RobotError, CameraError: the hardware fails, and does not come back in time.
        """
        if is_embedded(self._config.port):
            self._clock = hardware.robot.clock
        camera = CheckedCamera(hardware.camera, limits_of(brain.eyes))
        rng = np.random.default_rng(self._config.seed)
        self._tell_map(brain)
        with (
            CameraWatch(camera, self._config.camera_limit) as watch,
            self._bell() as bell,
            # the inner one: the robot is stopped first
            standing_on_failure(hardware.robot, LONGEST_WAY),
        ):
            timed = _TimedPlanner(planner, bell, lambda: self._say(Phase.DRIVING))
            guards = [self._interruption.check, watch.guard]
            if self._publisher:
                guards.append(self._publisher.check)
            guard = all_of(*guards)
            driver = Driver(hardware.robot, self._settings, guard)
            agent = Agent(brain, driver, self._watched(camera))
            while True:
                try:
                    return self._drive_on(agent, timed, rng, hardware)
                except (RobotError, CameraError) as error:
                    self._get_over(error, hardware, camera)

    def _drive_on(
        self, agent: Agent, planner: Planner, rng: np.random.Generator, hardware: Hardware
    ) -> Ending:
        self._time = self._clock()
        self._odometry = Odometry(pose=self._odometry.pose, counters=(0, 0))
        self._say(Phase.DRIVING)
        for step in drive(agent, planner, rng, self._config.commands - self.driven):
            self._time = self._clock()
            self._in_a_row = 0
            self._count(step)
            if self._publisher:
                self._publisher.link(link_of(hardware.robot.meter.read(), self._time))
            self._interruption.check()
            if step.outcome.collided:
                return Ending.COLLISION
        return Ending.COMMANDS

    def _get_over(self, error: MacorError, hardware: Hardware, camera: CheckedCamera) -> None:
        """Stop, wait until robot and camera work again, and know where that leaves the robot.

        Raises:
            RobotError, CameraError: they do not in time; or nothing but failures comes.
        """
        is_told_to_end = self._config.recovery <= 0.0 or self._interruption.name
        if is_told_to_end or is_hopeless(error, camera):
            raise error
        robot = hardware.robot
        self._in_a_row += 1
        if self._in_a_row > _IN_A_ROW:
            raise error
        _log.warning("recovering from: %s", error)
        self._say(Phase.RECOVERING, str(error))
        deadline = robot.clock() + self._config.recovery
        self._until(deadline, lambda: robot.recover(_SLICE), robot)
        self._until(deadline, camera.grab, robot)
        self._odometry = self._advance(robot.counters())
        self.recoveries += 1

    def _until(self, deadline: float, attempt: Callable[[], object], robot: Khepera) -> None:
        """Try something until it works, or until a deadline."""
        while True:
            self._interruption.check()
            try:
                attempt()
            except (RobotError, CameraError):
                if robot.clock() > deadline:
                    raise
                robot.wait(_PAUSE)
            else:
                return

    def _bell(self) -> LateBell:
        """Rings when the planner has not decided for a while. The robot stands meanwhile."""
        limit = self._config.planner_limit
        reason = f"the planner has not decided for {limit:g} s; the robot stands"

        def ring() -> None:
            _log.warning(reason)
            self._say(Phase.LATE, reason)

        return LateBell(limit, ring)

    def _watched(self, camera: Camera) -> Camera:
        return PublishingCamera(camera, self._publisher.frame) if self._publisher else camera

    def _tell_map(self, brain: Brain) -> None:
        self._time = self._clock()
        if self._publisher:
            with _telling():
                self._publisher.learned(learned_of(brain), self._time)

    def _count(self, step: Step) -> None:
        self.total += step.reinforcement
        self._odometry = self._advance(step.outcome.counters)
        sequence, self.driven = self.driven, self.driven + 1
        with _telling():
            decision = decision_of(
                step,
                time=self._time,
                sequence=sequence,
                total_reinforcement=self.total,
                odometry=self._odometry,
            )
            if self._publisher:
                self._publisher.decision(decision)
            self._say(Phase.DRIVING)
            if self._on_step:
                self._on_step(decision)

    def _advance(self, counters: tuple[int, int]) -> Odometry:
        before = self._odometry
        pose = integrate(before.pose, before.counters, counters, self._settings.wheels)
        return Odometry(pose=pose, counters=counters)

    def _say(self, phase: Phase, reason: str = "") -> None:
        if self._publisher is None:
            return
        with _telling():
            state = State(
                phase=phase,
                planner=self._config.planner[:MOST_TEXT],
                port=self._config.port[:MOST_TEXT],
                camera=self._config.camera[:MOST_TEXT],
                map=str(self._config.map_file)[:MOST_TEXT],
                driven=self.driven,
                limit=self._config.commands,
                reason=reason[:MOST_TEXT],
            )
            self._publisher.state(state, self._time)


@contextmanager
def _telling() -> Iterator[None]:
    """Log what is out of the bounds of its payload: a robot drives on though nobody hears of it."""
    try:
        yield
    except ValidationError as error:
        _log.warning("something could not be told: %s", first_fault(error))


class _TimedPlanner:
    """A planner that is timed while it plans.

    Args:
        planner: who plans.
        bell: rings when it takes long.
        decided: called when it has decided after that.
    """

    def __init__(self, planner: Planner, bell: LateBell, decided: Callable[[], None]) -> None:
        self._planner = planner
        self._bell = bell
        self._decided = decided

    @property
    def memory(self) -> str:
        """Name of the memory that the planner reads."""
        return self._planner.memory

    def plan(self, memory: Any, now: Moment) -> Plan:
        """Let the planner plan."""
        with self._bell.timing(self._decided):
            return self._planner.plan(memory, now)
