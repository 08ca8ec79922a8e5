"""Motor commands of the paper, driven with the robot's position controller.

A command is an arc: both wheels get a target (C) and a speed profile (J) scaled so that they
arrive together. While they turn, the infrared sensors are watched: a body about to touch
something is stopped, and that is what the controller calls a collision. A target that is not
reached in time is one, too. Nothing here knows whether the robot is a real one.

The robot turns its wheels only while somebody here looks on: whatever else the controller does,
it stands. A guard is asked between any two looks, and what it raises ends the drive. Nothing that
is raised leaves a drive before the robot stands.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf, sqrt

from khepera_protocol.serial.units import ACCELERATION_UNIT, PULSE, SPEED_UNIT

from macor_hil.commands import LONGEST_WAY as LONGEST_WAY
from macor_hil.commands import MotorCommand
from macor_hil.errors import RobotResetError, StrayedError
from macor_hil.hardware.odometry import Wheels
from macor_hil.hardware.robots.robot import (
    FRONT_SENSORS,
    Arc,
    Arrival,
    Followed,
    Robot,
    WheelStatus,
)
from macor_hil.hardware.standstill import standing_on_failure


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """Settings of the driver.

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
    """Outcome of a driven command.

    Attributes:
        collided: whether it was cut short.
        proximity: the last infrared reading.
        counters: encoder counters after it.
    """

    collided: bool
    proximity: tuple[int, ...]
    counters: tuple[int, int]


Guard = Callable[[], None]
"""Asked again and again while the robot drives; raises when it must not go on."""

_Counts = tuple[int, int]

_Going = Callable[[_Counts, tuple[float, float]], Arrival]
"""A way of driving from counts by the ways of both wheels."""


def all_of(*guards: Guard) -> Guard:
    """Return a guard that asks several, in their order."""

    def guard() -> None:
        for each in guards:
            each()

    return guard


LEASH = 0.15
"""Metres that a leg's target is ahead of the wheels at most: what they turn on if left alone."""

_SLACK_LEASH = 0.8
"""Share of the leash at which the target moves on."""

_HELD_UP = 0.25
"""Seconds between two looks from which on it is this computer that is late, and not the robot."""

_LONGEST = 5.0
"""Times the patience that a robot gets at most, however often or slowly it is looked at."""

_TRAIL = 64
_SLACK = 40
"""Counts that a wheel may be beside its way: 3 mm."""


def profiles_of(
    settings: DriveSettings, ways: tuple[float, float]
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return speed and acceleration of both wheels that let them arrive together; units of J."""
    longest = _longest(ways)
    left, right = (
        (
            max(1, round(settings.speed * abs(way) / longest)),
            max(1, round(settings.acceleration * abs(way) / longest)),
        )
        for way in ways
    )
    return left, right


def duration_of(settings: DriveSettings, counts: float, leash: float = inf) -> float:
    """Return the seconds that the profile needs for some counts, with a target so far ahead."""
    way = counts * PULSE
    acceleration = settings.acceleration * ACCELERATION_UNIT
    # half a leash is left at times, from which the robot must be able to brake
    top = min(settings.speed * SPEED_UNIT, sqrt(acceleration * leash * PULSE))
    if way < top**2 / acceleration:
        return 2 * sqrt(way / acceleration)
    return way / top + top / acceleration


def counts_within(speed: int, acceleration: int, seconds: float) -> float:
    """Return the counts that a profile goes from rest to rest in some seconds.

    No robot on its way needs longer for its last counts, however fast it is.

    Args:
        speed: of the profile, in the units of J.
        acceleration: of the profile.
        seconds: how long.
    """
    top, rise = speed * SPEED_UNIT, acceleration * ACCELERATION_UNIT
    if top > rise * seconds / 2:
        return rise * seconds**2 / 4 / PULSE
    return top * (seconds - top / rise) / PULSE


def _longest(ways: tuple[float, float]) -> float:
    return max(abs(ways[0]), abs(ways[1]), 1.0)


def _nothing() -> None:
    """Let it drive."""


def is_touching(proximity: tuple[int, ...], settings: DriveSettings) -> bool:
    """Return True if infrared readings say that the body is about to touch something ahead."""
    return max(proximity[FRONT_SENSORS]) >= settings.collision


class Driver:
    """Executes motor commands on a robot, and drives back the way it came.

    Args:
        robot: the robot.
        settings: how it is driven.
        guard: what must hold while it drives; None: nothing.
        patient: whether the guard need not be asked between any two looks at a robot in this
            process, which drives a command in a millisecond.
        alone: seconds in which a robot comes to rest that nobody can stop any more; None: it goes
            to the end of its command, or of a leg's leash.

    Attributes:
        settings: how it is driven.
    """

    def __init__(
        self,
        robot: Robot,
        settings: DriveSettings = DriveSettings(),
        guard: Guard | None = None,
        *,
        patient: bool = False,
        alone: float | None = None,
    ) -> None:
        # no faster than the robot can: times are reckoned with it
        self.settings = replace(settings, speed=min(settings.speed, robot.top_speed))
        self._robot = robot
        self._guard = guard or _nothing
        unguarded = patient or guard is None
        self._followed = robot if unguarded and isinstance(robot, Followed) else None
        self._alone = alone
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
        with standing_on_failure(self._robot, command.way):
            self._trail.append(self._target)
            return self._driven(command.way, command.turn, self._go_at_once)

    def hold(self, left: int, right: int, seconds: float, *, roll_on: bool = False) -> Outcome:
        """Hold wheel speeds for a time, or until a collision; then the robot stands.

        Args:
            left: speed of the left wheel, counts / 10 ms, cut to the greatest of the settings.
            right: that of the right wheel.
            seconds: how long, on the robot's clock.
            roll_on: let the wheels turn on for the next call. For a robot whose time stands still
                between two calls (`khepera://`); any other would be on its own.

        Raises:
            RobotError: the robot does not answer.
        """
        top = self.settings.speed
        with standing_on_failure(self._robot, top * SPEED_UNIT * seconds):
            self._robot.set_speed(max(-top, min(top, left)), max(-top, min(top, right)))
            end = self._robot.clock() + seconds
            while True:
                self._guard()
                proximity = self._watch(end)
                collided = is_touching(proximity, self.settings)
                if collided or self._robot.clock() >= end:
                    break
            if collided or not roll_on:
                self._robot.stop()
            return Outcome(collided, proximity, self._robot.counters())

    def leg(self, way: float, turn: float) -> Outcome:
        """Drive a straight way, or turn on the spot, of any length, to its end or a collision.

        The robot's target is never farther ahead of its wheels than a leash, and moves on while
        somebody looks: a robot that is left alone comes to rest.

        Args:
            way: metres, backwards if negative.
            turn: radians, to the left; one of both is 0.

        Raises:
            StrayedError: the robot is elsewhere than on the way of this leg.
            RobotError: the robot does not answer, or has been reset.
        """
        with standing_on_failure(self._robot, LEASH):
            return self._driven(way, turn, self._go_on_a_leash)

    def back_off(self, commands: int) -> None:
        """Drive back along the trail by up to a number of commands.

        Raises:
            RobotError: the robot does not answer.
        """
        with standing_on_failure(self._robot, LONGEST_WAY):
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
        with standing_on_failure(self._robot, 0.0):
            ways = self.settings.wheels.counts(0.0, angle)
            self._target = self._target[0] + round(ways[0]), self._target[1] + round(ways[1])
            self._go(self._target, ways, watch=False)
            self._robot.stop()
            self._target = self._robot.counters()

    def _driven(self, way: float, turn: float, go: _Going) -> Outcome:
        """Drive from the target so far to the next one, and check that the robot came there."""
        begin = self._target
        ways = self.settings.wheels.counts(way, turn)
        self._target = begin[0] + round(ways[0]), begin[1] + round(ways[1])
        collided, proximity, counters = go(begin, ways)
        self._check(begin, counters)
        if collided:
            self._target = counters
        return Outcome(collided, proximity, counters)

    def _go_at_once(self, _begin: _Counts, ways: tuple[float, float]) -> Arrival:
        if self._followed is not None:
            settings = self.settings
            left, right = profiles_of(settings, ways)
            seconds = duration_of(settings, _longest(ways))
            profile, limit = (*left, *right), settings.collision
            arc = Arc(profile, self._target, limit, seconds, settings.patience)
            if (arrival := self._followed.drive(arc)) is not None:
                return arrival
        return self._arrived(*self._go(self._target, ways, watch=True))

    def _arrived(self, proximity: tuple[int, ...], collided: bool) -> Arrival:
        """Stop after a collision, and ask for the counters."""
        if collided:
            self._robot.stop()
        return Arrival(collided, proximity, self._robot.counters())

    def _go(
        self, target: tuple[int, int], ways: tuple[float, float], *, watch: bool
    ) -> tuple[tuple[int, ...], bool]:
        settings, robot = self.settings, self._robot
        if self._alone is not None:
            leash = counts_within(settings.speed, settings.acceleration, self._alone)
            begin = target[0] - round(ways[0]), target[1] - round(ways[1])
            return self._go_ahead(begin, ways, leash, watch=watch)
        robot.set_profile(*profiles_of(settings, ways))
        robot.go_to(*target)
        start = robot.clock()
        duration = duration_of(settings, _longest(ways))
        deadline = _Deadline(duration, settings.patience)
        while True:
            self._guard()
            proximity = robot.proximity()
            elapsed = robot.clock() - start
            late = deadline.passed(elapsed)
            if watch and is_touching(proximity, settings):
                return proximity, True
            if elapsed < duration:
                continue
            left, right = robot.status()
            if left.reached and right.reached:
                return proximity, False
            self._check_remembered(left, right)
            if late:
                return proximity, True

    def _watch(self, end: float) -> tuple[int, ...]:
        """Look at the sensors, of a robot in this process until a collision or a time."""
        if self._followed is not None:
            return self._followed.watch(self.settings.collision, end)
        return self._robot.proximity()

    def _go_on_a_leash(self, begin: _Counts, ways: tuple[float, float]) -> Arrival:
        return self._arrived(*self._on_a_leash(begin, ways))

    def _on_a_leash(
        self, begin: _Counts, ways: tuple[float, float]
    ) -> tuple[tuple[int, ...], bool]:
        wheels = self.settings.wheels
        return self._go_ahead(begin, ways, LEASH / min(wheels.left, wheels.right), watch=True)

    def _go_ahead(
        self, begin: _Counts, ways: tuple[float, float], leash: float, *, watch: bool
    ) -> tuple[tuple[int, ...], bool]:
        """Drive to targets that move on with the robot, so many counts ahead at most."""
        settings, robot = self.settings, self._robot
        longest = _longest(ways)
        robot.set_profile(*profiles_of(settings, ways))
        start = robot.clock()
        deadline = _Deadline(duration_of(settings, longest, leash), settings.patience)
        ahead = 0.0
        left = right = WheelStatus(reached=False, speed_mode=False, error=0)
        while not (ahead == longest and left.reached and right.reached):
            behind = max(abs(left.error), abs(right.error))
            if ahead < longest and behind < _SLACK_LEASH * leash:
                ahead = min(longest, ahead - behind + leash)
                share = ahead / longest
                robot.go_to(begin[0] + round(ways[0] * share), begin[1] + round(ways[1] * share))
            self._guard()
            proximity = robot.proximity()
            touching = watch and is_touching(proximity, settings)
            if deadline.passed(robot.clock() - start) or touching:
                return proximity, True
            left, right = robot.status()
            self._check_remembered(left, right)
        return proximity, False

    def _check_remembered(self, *wheels: WheelStatus) -> None:
        """See that the robot knows of the target that it was sent to."""
        if any(wheel.speed_mode and not wheel.reached for wheel in wheels):
            raise RobotResetError(
                f"sent to {self._target}, and the robot knows nothing of it: it has started again;"
                " is its battery low?"
            )

    def _check(self, begin: tuple[int, int], counters: tuple[int, int]) -> None:
        """Nothing on the line protects a number; the counters tell where it has led."""
        for first, last, now in zip(begin, self._target, counters, strict=True):
            if not min(first, last) - _SLACK <= now <= max(first, last) + _SLACK:
                raise StrayedError(
                    f"sent from {begin} to {self._target} and got to {counters}: the request did"
                    " not arrive as it was sent, or the robot was reset"
                )


class _Deadline:
    """The time after which a robot that is not there has met something.

    One that is steered from here drives on while nobody looks, and drives back: it gets more time
    where this computer was late, to a limit.

    Args:
        duration: seconds of the way.
        patience: seconds that it may take beyond that.
    """

    def __init__(self, duration: float, patience: float) -> None:
        self._duration = duration
        self._patience, self._most = patience, _LONGEST * patience
        self._looked = 0.0

    def passed(self, elapsed: float) -> bool:
        """Tell whether it has passed at a look, so many seconds after the start."""
        between, self._looked = elapsed - self._looked, elapsed
        self._patience = min(self._patience + 2.0 * max(0.0, between - _HELD_UP), self._most)
        return elapsed > self._duration + self._patience
