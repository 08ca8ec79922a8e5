"""Reports of a live run: what watchers and the caller are told while it drives."""

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from math import inf
from types import TracebackType
from typing import Self

from khepera_protocol.system.supervisor import NOBODY, Supervisor
from khepera_protocol.validation import first_fault
from khepera_protocol.zenoh.controller_payloads import Decision, Odometry, Phase, State
from khepera_protocol.zenoh.payload_model import MOST_TEXT
from khepera_protocol.zenoh.payloads import USUAL_ROBOT, Pose
from pydantic import ValidationError

from macor_hil.hardware.cameras import Camera, Frame
from macor_hil.hardware.line.line_statistics import Durations, Meter
from macor_hil.hardware.odometry import Wheels, integrate
from macor_hil.hardware.robots.robot import Robot
from macor_hil.mind.brain import Brain
from macor_hil.mind.planners.planner import Aim
from macor_hil.runs.agent import Step
from macor_hil.runs.decision_samples import decision_of, learned_of, link_of
from macor_hil.runs.options import RunOptions
from macor_hil.safety.interruption import Interruption
from macor_hil.telemetry.metrics import Figures
from macor_hil.telemetry.publisher import Publisher, PublishingCamera
from macor_hil.telemetry.steady_clock import SteadyClock

_log = logging.getLogger(__name__)

OnStep = Callable[[Decision], None]


class Ending(StrEnum):
    """Reason why a run ended, where nothing failed."""

    COMMANDS = "all commands driven"
    COLLISION = "collision"
    GOAL = "goal reached"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, slots=True)
class RunReport:
    """Outcome of a run.

    Attributes:
        ending: why it ended.
        commands: how many were driven, a colliding one included.
        reinforcement: their sum.
        signal: what interrupted it, such as SIGTERM or the stop key; empty otherwise.
        recoveries: failures of robot or camera that it recovered from; each cost a command.
        collisions: how many there were.
        learned: commands learned while driving, in this run and in those before.
    """

    ending: Ending
    commands: int
    reinforcement: float
    signal: str = ""
    recoveries: int = 0
    collisions: int = 0
    learned: int = 0

    @property
    def collided(self) -> bool:
        """True where a collision ended the run."""
        return self.ending is Ending.COLLISION


class RunReporter:
    """Counts what is driven, and tells it; as a context it tells how the run ended.

    Args:
        options: of the run.
        interruption: what may end it.
        wheels: that odometry counts with.
        start: where odometry begins.
        publisher: tells watchers; None: nobody watches.
        on_step: hears every decision when its outcome is known.
        supervisor: who has started the program, and is told the state.

    Attributes:
        driven: commands so far.
        total: their reinforcement.
        recoveries: failures that the run recovered from.
        collisions: how many there were.
        lived: commands learned while driving, those of earlier runs included.
        plans, commands: times of planning, and from one decision to the next.
        ending: why it ended.
    """

    def __init__(
        self,
        options: RunOptions,
        interruption: Interruption,
        wheels: Wheels,
        start: Pose,
        publisher: Publisher | None = None,
        on_step: OnStep | None = None,
        supervisor: Supervisor = NOBODY,
    ) -> None:
        self.driven = 0
        self.total = 0.0
        self.recoveries = self.collisions = self.lived = 0
        self.plans, self.commands = Durations(), Durations()
        self.ending = Ending.INTERRUPTED
        self._supervisor = supervisor
        self._phase = Phase.STARTING
        self._kind = USUAL_ROBOT  # until it is there
        self._meter = Meter()
        self._seen = self._decided = -inf
        self._interruption = interruption
        self._options = options
        self._wheels = wheels
        self._odometry = Odometry(pose=start, counters=(0, 0))
        self._publisher = publisher
        self._on_step = on_step
        # an embedded robot's clock begins when its port is opened
        self._clock: Callable[[], float] = SteadyClock().seconds
        self._time = 0.0 if options.address.embedded else self._clock()

    def __enter__(self) -> Self:
        self.say(Phase.STARTING)
        return self

    def __exit__(
        self,
        _: type[BaseException] | None,
        error: BaseException | None,
        __: TracebackType | None,
    ) -> None:
        if error is None:
            signal = f" by {self._interruption.name}" if self._interruption.name else ""
            self.say(Phase.STOPPED, f"{self.ending}{signal}")
        else:
            self.say(Phase.FAILED, str(error) or type(error).__name__)

    def report(self) -> RunReport:
        """Return the outcome of the run."""
        return RunReport(
            self.ending,
            self.driven,
            self.total,
            self._interruption.name,
            self.recoveries,
            self.collisions,
            self.lived,
        )

    def figures(self) -> Figures:
        """Return the figures of this moment; for other threads."""
        age = time.monotonic() - self._seen
        return Figures(
            decisions=self.driven,
            collisions=self.collisions,
            recoveries=self.recoveries,
            learned=self.lived,
            failures=self._meter.failures,
            waiting=self._publisher.waiting if self._publisher else 0,
            camera_age=None if age == inf else age,
            driving=self._phase is Phase.DRIVING,
            exchanges=self._meter.times,
            plans=self.plans,
            commands=self.commands,
        )

    def follow(self, robot: Robot) -> None:
        """Take kind and figures of the line from a robot, and the time from an embedded one."""
        self._meter = robot.meter
        self._kind = robot.kind.value
        if self._options.address.embedded:
            self._clock = robot.clock

    def watched(self, camera: Camera) -> Camera:
        """Return a camera whose pictures watchers see, too."""
        return PublishingCamera(camera, self._picture)

    def _picture(self, frame: Frame) -> None:
        self._seen = time.monotonic()
        if self._publisher:
            self._publisher.frame(frame)

    def check(self) -> None:
        """Raise an error where watchers are told nothing any more."""
        if self._publisher:
            self._publisher.check()

    def learned(self, brain: Brain) -> None:
        """Tell what is driven by."""
        self._time = self._clock()
        if self._publisher:
            with _telling():
                self._publisher.learned(learned_of(brain), self._time)

    def missing(self, why: str) -> None:
        """Tell that robot or camera are waited for, and why."""
        _log.warning("waiting: %s", why)
        self.say(Phase.STARTING, why)

    def begin(self) -> None:
        """Tell that the robot drives, or drives again: its counters begin at 0."""
        self._time = self._clock()
        self._decided = time.monotonic()
        self._odometry = Odometry(pose=self._odometry.pose, counters=(0, 0))
        self.say(Phase.DRIVING)

    def change_course(self, options: RunOptions) -> None:
        """Tell of another planner or goal from now on."""
        self._options = options
        self.say(Phase.DRIVING)

    def count(self, step: Step, robot: Robot, aim: Aim | None = None) -> None:
        """Count a step, and tell it.

        Args:
            step: what was driven.
            robot: that drove it.
            aim: the planner's goal as it is seen after it; None: it has none.
        """
        self._time = self._clock()
        now = time.monotonic()
        self.commands.add(now - self._decided)
        self._decided = now
        self.collisions += step.outcome.collided
        self.total += step.reinforcement
        self.move_to(step.outcome.counters)
        sequence, self.driven = self.driven, self.driven + 1
        with _telling():
            decision = decision_of(
                step,
                time=self._time,
                sequence=sequence,
                total_reinforcement=self.total,
                odometry=self._odometry,
                aim=aim,
            )
            if self._publisher:
                self._publisher.decision(decision)
            self.say(Phase.DRIVING)
            if self._on_step:
                self._on_step(decision)
        if self._publisher:
            self._publisher.link(link_of(robot.meter.read(), self._time))

    def move_to(self, counters: tuple[int, int]) -> None:
        """Let odometry follow the wheels' counters."""
        before = self._odometry
        pose = integrate(before.pose, before.counters, counters, self._wheels)
        self._odometry = Odometry(pose=pose, counters=counters)

    def say(self, phase: Phase, reason: str = "") -> None:
        """Tell how the run is, and why."""
        self._phase = phase
        self._supervisor.status(f"{phase.value}: {reason}" if reason else phase.value)
        if self._publisher is None:
            return
        options = self._options
        with _telling():
            state = State(
                phase=phase,
                planner=options.planner_name[:MOST_TEXT],
                port=options.port[:MOST_TEXT],
                camera=options.camera[:MOST_TEXT],
                map=str(options.map_file)[:MOST_TEXT],
                driven=self.driven,
                limit=options.commands,
                reason=reason[:MOST_TEXT],
                robot_kind=self._kind,
            )
            self._publisher.state(state, self._time)


@contextmanager
def _telling() -> Iterator[None]:
    """Log what is out of the bounds of its payload: a robot drives on though nobody hears of it."""
    try:
        yield
    except ValidationError as error:
        _log.warning("something could not be told: %s", first_fault(error))
