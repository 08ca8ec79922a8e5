"""Reports of a drive by hand, as a controller's: state, decisions, where the wheels have led."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Final

from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.controller_payloads import (
    Alternative,
    Command,
    Decision,
    Eye,
    Fields,
    Learned,
    Odometry,
    Phase,
    Situation,
    State,
)
from khepera_protocol.zenoh.payload_model import MOST_TEXT
from khepera_protocol.zenoh.payloads import USUAL_ROBOT, Pose

from macor_hil.commands import COMMANDS, MotorCommand
from macor_hil.hardware.cameras import Frame
from macor_hil.hardware.driver import Outcome
from macor_hil.hardware.odometry import Wheels, integrate
from macor_hil.hardware.robots.robot import Robot
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.runs.by_hand.options import TeleopOptions
from macor_hil.telemetry.publisher import Publisher
from macor_hil.telemetry.steady_clock import SteadyClock

NAME: Final = "by hand"
"""Text in the place of a planner's name."""

_UNRECOGNISED: Final = Situation(node=0, neuron=0, resonant=False, match=0.0)
"""The situation of a robot that recognises nothing."""


class Teller:
    """Tells watchers of a drive; use `telling` as a context around it.

    Args:
        publisher: tells it.
        options: what is driven.
        wheels: that odometry counts with.
        mirror: that the camera looks into.

    Attributes:
        driven: commands so far.
        ending: words on why the drive ended.
    """

    def __init__(
        self, publisher: Publisher, options: TeleopOptions, wheels: Wheels, mirror: Mirror
    ) -> None:
        self.driven = 0
        self.ending = "ended by its key"
        self._publisher = publisher
        self._port, self._camera = options.port[:MOST_TEXT], options.camera[:MOST_TEXT]
        self._embedded = options.address.embedded
        self._wheels = wheels
        self._mirror = mirror
        self._reinforcement = Reinforcement()
        self._total = 0.0
        self._odometry = Odometry(pose=Pose(x=0.0, y=0.0, heading=0.0), counters=(0, 0))
        self._clock: Callable[[], float] = SteadyClock().seconds
        self._time = 0.0
        self._kind = USUAL_ROBOT  # until it is there

    @contextmanager
    def telling(self, robot: Robot) -> Iterator[None]:
        """Tell that a drive of a robot begins, and how it ends."""
        if self._embedded:
            self._clock = robot.clock
        self._kind = robot.kind.value
        self._time = self._clock()
        self._publisher.learned(
            Learned(
                situations=0,
                transitions=0,
                commands=[Command(**asdict(command)) for command in COMMANDS],
                fields=Fields(sectors=0, width=0.0, channels=[]),
                eye=Eye(**asdict(self._mirror)),
            ),
            self._time,
        )
        self.say(Phase.DRIVING)
        try:
            yield
        except BaseException as error:
            self.say(Phase.FAILED, str(error) or type(error).__name__)
            raise
        self.say(Phase.STOPPED, self.ending)

    def say(self, phase: Phase, reason: str = "") -> None:
        """Tell how the drive is."""
        state = State(
            phase=phase,
            planner=NAME,
            port=self._port,
            camera=self._camera,
            map="",
            driven=self.driven,
            limit=0,
            reason=reason[:MOST_TEXT],
            robot_kind=self._kind,
        )
        self._publisher.state(state, self._time)

    def begin(self) -> None:
        """Take in that the robot's counters begin at 0 again."""
        self._odometry = Odometry(pose=self._odometry.pose, counters=(0, 0))

    def move_to(self, counters: tuple[int, int]) -> None:
        """Let odometry follow the wheels' counters."""
        before = self._odometry
        pose = integrate(before.pose, before.counters, counters, self._wheels)
        self._odometry = Odometry(pose=pose, counters=counters)

    def count(self, command: MotorCommand, before: Frame, outcome: Outcome) -> Decision:
        """Tell a command that was driven as a decision.

        Args:
            command: it.
            before: the picture before it.
            outcome: how it went.
        """
        earned = self._reinforcement(command, outcome.collided)
        self._total += earned
        self._time = self._clock()
        self.move_to(outcome.counters)
        decision = Decision(
            time=self._time,
            sequence=self.driven,
            frame_time=before.time,
            situation=_UNRECOGNISED,
            alternatives=[Alternative(command=each.name) for each in COMMANDS],
            command=command.name,
            steps=0,
            sequence_ahead=[],
            hypotheses=[],
            activities=[],
            features=[],
            reinforcement=earned,
            total_reinforcement=self._total,
            collided=outcome.collided,
            infrared=list(outcome.proximity),
            odometry=self._odometry,
        )
        self.driven += 1
        self._publisher.decision(decision)
        self.say(Phase.DRIVING)
        return decision
