"""Motor commands of the paper, driven with the robot's position controller.

A command is an arc: both wheels get a target (C) and a speed profile (J) scaled so that they
arrive together. While they turn, the infrared sensors are watched: a body about to touch
something is stopped, and that is what the controller calls a collision. A target that is not
reached in time is one, too. Nothing here knows whether the robot is a real one.

The robot turns its wheels only while somebody here looks on: whatever else the controller does,
it stands. A guard is asked between any two looks, and what it raises ends the drive.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from math import sqrt

from macor_hil.commands import MotorCommand
from macor_hil.errors import RobotResetError, StrayedError
from macor_hil.odometry import Wheels
from macor_hil.robot import Khepera
from protocol.units import ACCELERATION_UNIT, PULSE, SPEED_UNIT


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """How commands are driven.

    Attributes:
        wheels: what counts mean.
        speed, acceleration: profile of the faster wheel, in the units of J: 1 to 127 and 1 to 255.
            No wheel is ever told to turn faster.
        collision: proximity reading of one of the six front and side sensors from which on the
            robot counts as touching. A saturated sensor sees a white wall within 15 to 20 mm.
        patience: seconds that a command may take beyond its profile's time.
    """

    wheels: Wheels = field(default_factory=Wheels)
    speed: int = 20
    acceleration: int = 64
    collision: int = 1000
    patience: float = 0.5


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a command came to.

    Attributes:
        collided: whether it was cut short.
        proximity: the last infrared reading.
        counters: encoder counters after it.
    """

    collided: bool
    proximity: tuple[int, ...]
    counters: tuple[int, int]


FRONT_SENSORS = slice(0, 6)
"""Infrared sensors that face where the robot can drive to: all but the two at the back."""

Guard = Callable[[], None]
"""Asked again and again while the robot drives; raises when it must not go on."""

_TRAIL = 64
_SLACK = 40
"""Counts that a wheel may be beside its way: 3 mm."""


def is_touching(proximity: tuple[int, ...], settings: DriveSettings) -> bool:
    """Whether infrared readings say that the body is about to touch something it can drive into."""
    return max(proximity[FRONT_SENSORS]) >= settings.collision


class Driver:
    """Executes motor commands on a robot, and drives back the way it came.

    Args:
        robot: the robot.
        settings: how it is driven.
        guard: what must hold while it drives.
    """

    def __init__(
        self,
        robot: Khepera,
        settings: DriveSettings = DriveSettings(),
        guard: Guard = lambda: None,
    ) -> None:
        self._robot = robot
        self._settings = settings
        self._guard = guard
        self._target = (0, 0)
        self._trail: deque[tuple[int, int]] = deque(maxlen=_TRAIL)

    def start(self) -> None:
        """Begin here: stop, zero the counters, forget the way."""
        self._robot.stop()
        self._robot.set_counters(0, 0)
        self._target = (0, 0)
        self._trail.clear()

    def execute(self, command: MotorCommand) -> Outcome:
        """Drive one command to its end, or to a collision.

        Raises:
            StrayedError: the robot is elsewhere than on the way of this command.
            RobotError: the robot does not answer, or has been reset.
        """
        begin = self._target
        self._trail.append(begin)
        ways = self._settings.wheels.counts(command.way, command.turn)
        self._target = self._target[0] + round(ways[0]), self._target[1] + round(ways[1])
        proximity, collided = self._go(self._target, ways, watch=True)
        if collided:
            self._robot.stop()
        counters = self._robot.counters()
        self._check(begin, counters)
        if collided:
            self._target = counters
        return Outcome(collided, proximity, counters)

    def back_off(self, commands: int) -> None:
        """Drive back along the trail by up to a number of commands.

        Raises:
            RobotError: the robot does not answer.
        """
        for _ in range(min(commands, len(self._trail))):
            target = self._trail.pop()
            ways = float(target[0] - self._target[0]), float(target[1] - self._target[1])
            self._target = target
            self._go(target, ways, watch=False)
        self._robot.stop()
        self._target = self._robot.counters()

    def turn(self, angle: float) -> None:
        """Turn on the spot by radians, to the left; a round body has always room for that.

        Raises:
            RobotError: the robot does not answer.
        """
        ways = self._settings.wheels.counts(0.0, angle)
        self._target = self._target[0] + round(ways[0]), self._target[1] + round(ways[1])
        self._go(self._target, ways, watch=False)
        self._robot.stop()
        self._target = self._robot.counters()

    def _go(
        self, target: tuple[int, int], ways: tuple[float, float], *, watch: bool
    ) -> tuple[tuple[int, ...], bool]:
        settings, robot = self._settings, self._robot
        longest = max(abs(ways[0]), abs(ways[1]), 1.0)
        profiles = [
            (
                max(1, round(settings.speed * abs(way) / longest)),
                max(1, round(settings.acceleration * abs(way) / longest)),
            )
            for way in ways
        ]
        robot.set_profile(profiles[0], profiles[1])
        robot.go_to(*target)
        start = robot.clock()
        duration = self._duration(longest)
        while True:
            self._guard()
            proximity = robot.proximity()
            if watch and is_touching(proximity, settings):
                return proximity, True
            elapsed = robot.clock() - start
            if elapsed < duration:
                continue
            left, right = robot.status()
            if left.reached and right.reached:
                return proximity, False
            if (left.speed_mode and not left.reached) or (right.speed_mode and not right.reached):
                raise RobotResetError(
                    f"sent to {target}, and the robot knows nothing of it: it has started again; is"
                    " its battery low?"
                )
            if elapsed > duration + settings.patience:
                return proximity, True

    def _check(self, begin: tuple[int, int], counters: tuple[int, int]) -> None:
        """Nothing on the line protects a number; the counters tell where it has led."""
        for first, last, now in zip(begin, self._target, counters, strict=True):
            if not min(first, last) - _SLACK <= now <= max(first, last) + _SLACK:
                raise StrayedError(
                    f"sent from {begin} to {self._target} and got to {counters}: the request did"
                    " not arrive as it was sent, or the robot was reset"
                )

    def _duration(self, counts: float) -> float:
        """Seconds that the profile needs for a number of counts."""
        settings = self._settings
        way = counts * PULSE
        acceleration = settings.acceleration * ACCELERATION_UNIT
        top = settings.speed * SPEED_UNIT
        if way < top**2 / acceleration:
            return 2 * sqrt(way / acceleration)
        return way / top + top / acceleration
