"""Frames that a robot is drawn in, and how they lie in each other.

One tree: in the arena lies the frame of the odometry, in that the robot. Where nobody knows the
truth, both begin as one. What the odometry lacks of the truth moves its frame, not the robot.
"""

from collections.abc import Iterable, Sequence
from math import cos, sin
from typing import Final

from khepera_protocol.zenoh.controller_payloads import Ahead, Decision, Learned
from khepera_protocol.zenoh.payloads import Pose

from macor_hil.commands import COMMANDS
from macor_hil.hardware.odometry import Wheels, integrate

HERE: Final = Pose(x=0.0, y=0.0, heading=0.0)


def seen_from(frame: Pose, pose: Pose) -> Pose:
    """Return a pose in a frame, where the frame itself lies: both in one outer frame.

    Args:
        frame: of the inner frame in the outer one.
        pose: in the inner frame.
    """
    c, s = cos(frame.heading), sin(frame.heading)
    return _unbounded(
        x=frame.x + c * pose.x - s * pose.y,
        y=frame.y + s * pose.x + c * pose.y,
        heading=frame.heading + pose.heading,
    )


def turned_round(pose: Pose) -> Pose:
    """Return the outer frame as it lies in the inner one, of the inner one in the outer."""
    c, s = cos(pose.heading), sin(pose.heading)
    return _unbounded(x=-c * pose.x - s * pose.y, y=s * pose.x - c * pose.y, heading=-pose.heading)


def arc(turn: float, way: float) -> Pose:
    """Return where an arc of a length in metres that turns by radians ends, seen from its start."""
    half = turn / 2
    chord = way * (sin(half) / half if half else 1.0)
    return _unbounded(x=chord * cos(half), y=chord * sin(half), heading=turn)


def _unbounded(x: float, y: float, heading: float) -> Pose:
    """Return a pose that may lie beyond the bounds of payloads, as sums of those within may."""
    return Pose.model_construct(x=x, y=y, heading=heading)


class Whereabouts:
    """The latest poses of one robot, by its truth and by its odometry.

    Args:
        wheels: that the driver's counts are counted with; None: as they should be.

    Attributes:
        truth: in the arena; None where nobody knows it.
        odometry: by its encoders.
        start: of the latest decision, in the frame of the odometry.
    """

    def __init__(self, wheels: Wheels | None = None) -> None:
        self.truth: Pose | None = None
        self.odometry = HERE
        self.start = HERE
        self._commands = {each.name: (each.turn, each.way) for each in COMMANDS}
        self._last: int | None = None
        self._wheels = wheels or Wheels()
        self._counted: tuple[float, float] | None = None

    @property
    def origin(self) -> Pose:
        """The frame of the odometry in the arena."""
        return HERE if self.truth is None else seen_from(self.truth, turned_round(self.odometry))

    def learn(self, learned: Learned) -> None:
        """Take in the commands of a run."""
        self._commands = {each.name: (each.turn, each.way) for each in learned.commands}

    def decide(self, decision: Decision) -> None:
        """Take in a decision, whose command has been driven."""
        if decision.sequence - 1 == self._last:
            self.start = self.odometry
        else:  # a run begins, or one was missed: back along the command
            driven = arc(*self._commands.get(decision.command, (0.0, 0.0)))
            self.start = seen_from(decision.odometry.pose, turned_round(driven))
        self._last = decision.sequence
        self.odometry = decision.odometry.pose

    def count(self, counters: Sequence[int]) -> None:
        """Take in both counters of the driver's, where no decision tells the odometry."""
        left, right = counters
        before, self._counted = self._counted or (left, right), (left, right)
        self.odometry = integrate(self.odometry, before, self._counted, self._wheels)

    def lose_count(self) -> None:
        """Begin to count anew with the next counters: they were set, or somebody else drives."""
        self._counted = None

    def way(self, ahead: Iterable[Ahead]) -> list[Pose]:
        """Return the poses of hypothetical commands from the latest decision on, its own first.

        Commands that nobody knows end it.
        """
        poses = [self.start]
        for step in ahead:
            command = self._commands.get(step.command)
            if command is None:
                break
            poses.append(seen_from(poses[-1], arc(*command)))
        return poses
