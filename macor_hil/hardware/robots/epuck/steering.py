"""An e-puck driven as a Khepera is, whatever carries its numbers.

A look tells the wheels the speeds that they shall have, and brings infrared readings and step
counters. Whoever looks steers: between two looks the wheels turn on as they were told.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, Final, NamedTuple, TypeVar

from khepera_protocol.epuck.letters import wrapped
from khepera_protocol.epuck.units import STEP
from khepera_protocol.serial.units import ACCELERATION_UNIT, PULSE, SPEED_UNIT

from macor_hil.errors import GarbageError
from macor_hil.hardware.line.open_line import OpenLine
from macor_hil.hardware.robots.client import LineClient, looks_reset
from macor_hil.hardware.robots.epuck.readings import proximity_of
from macor_hil.hardware.robots.epuck.servo import Servo
from macor_hil.hardware.robots.robot import RobotKind, WheelStatus

_COUNTS: Final = STEP / PULSE
"""Counts of the driver for a step."""

_TOP: Final = 1000
"""Steps a second that every e-puck makes."""

_MOST: Final = 1100
"""Steps a second that the fastest of them makes."""

_NEAR_ZERO: Final = 25
"""Steps: a reset wheel has not got farther."""

Pair = tuple[int, int]
_Line = TypeVar("_Line", bound=OpenLine)


class Seen(NamedTuple):
    """The outcome of a look, as the robot tells it.

    Attributes:
        proximity: the eight infrared sensors.
        steps: low words of both counters, signed.
    """

    proximity: tuple[int, ...]
    steps: tuple[int, ...]


class SteeredEpuck(LineClient[_Line]):
    """An e-puck on an open port; use as a context, so that every way out stops it.

    Args:
        port: an open pySerial port.
        reopen: opens that port again after it has failed; None: it cannot be.
        line_of: makes the line of a port.
        stand: stops the robot on a line.
        stop: bytes that stop it.

    Attributes:
        clock: seconds on the clock that the port lives by.
        meter: counts requests and times their round trips on that clock.
    """

    kind = RobotKind.EPUCK
    top_speed = int(_TOP * STEP / SPEED_UNIT)
    _counted: float

    def __init__(
        self,
        port: Any,
        reopen: Callable[[], Any] | None,
        line_of: Callable[[Any], _Line],
        stand: Callable[[_Line], None],
        stop: bytes,
    ) -> None:
        super().__init__(port, reopen, line_of, stand)
        self._stop = stop
        self._steps = [0, 0]
        self._raw: Pair = (0, 0)
        self._wanted: Pair = (0, 0)
        self._told: Pair = (0, 0)
        self._wheels = Servo(), Servo()
        self._steering = False
        self._looked = 0.0

    @abstractmethod
    def _ask(self, speeds: Pair) -> Seen:
        """Tell the wheels their speeds, steps a second, and look, once.

        Raises:
            SilenceError, GarbageError: nothing came, or something that cannot be.
            LinkError: the port failed.
        """

    @abstractmethod
    def _read_steps(self) -> Pair:
        """Return the robot's counters, whatever it does."""

    def halt(self) -> None:
        """Stop the robot, whatever an interrupted exchange has left on the line.

        Raises:
            RobotError: no stop was confirmed.
        """
        self._rest()
        super().halt()

    def set_speed(self, left: int, right: int) -> None:
        """Hold wheel speeds, counts / 10 ms."""
        self._steering = False
        self._wanted = _steps_a_second(left), _steps_a_second(right)
        self._look()

    def stop(self) -> None:
        """Stand still."""
        self.set_speed(0, 0)

    def go_to(self, left: int, right: int) -> None:
        """Drive both wheels to counter values; whoever looks steers."""
        for wheel, target in zip(self._wheels, (left, right), strict=True):
            wheel.target = target / _COUNTS
        self._steering = True
        self._look()

    def set_profile(self, left: tuple[int, int], right: tuple[int, int]) -> None:
        """Top speed and acceleration of each wheel on its way to a target; protocol units."""
        for wheel, (speed, acceleration) in zip(self._wheels, (left, right), strict=True):
            wheel.top = min(speed * SPEED_UNIT / STEP, float(_TOP))
            wheel.acceleration = max(acceleration, 1) * ACCELERATION_UNIT / STEP

    def set_counters(self, left: int, right: int) -> None:
        """Let the counters of a robot that stands read so much; those of the robot stay."""
        self._look()
        self._steps = [round(left / _COUNTS), round(right / _COUNTS)]

    def counters(self) -> Pair:
        """Return the counters, left and right."""
        self._look()
        return self._counts()

    def status(self) -> tuple[WheelStatus, WheelStatus]:
        """State of the motion, left and right."""
        self._look()
        left, right = (
            WheelStatus(
                reached=self._steering and wheel.reached(steps),
                speed_mode=not self._steering,
                error=round(wheel.left_over(steps) * _COUNTS) if self._steering else 0,
            )
            for wheel, steps in zip(self._wheels, self._steps, strict=True)
        )
        return left, right

    def proximity(self) -> tuple[int, ...]:
        """Return the eight infrared sensors in the driver's scale and order."""
        return proximity_of(self._look().proximity)

    def _look(self) -> Seen:
        """Tell the wheels their speeds and see how it goes; steers them on."""
        seen = self._exchange()
        if self._steering:
            now = self.clock()
            elapsed, self._looked = now - self._looked, now
            left, right = (
                round(wheel.steer(steps, elapsed))
                for wheel, steps in zip(self._wheels, self._steps, strict=True)
            )
            self._wanted = left, right
            if self._wanted != self._told and not (left and right):
                seen = self._exchange()  # one of them is there: not at the next look, but now
        return seen

    def _exchange(self) -> Seen:
        """Send the speeds that are wanted, and take the answer in; what is lost is sent again."""
        # nobody looks while it is asked again
        seen = self._repeated(lambda: self._metered(self._checked), self._stop)
        self._told = self._wanted
        self._count(seen.steps)
        return seen

    def _checked(self) -> Seen:
        seen = self._ask(self._wanted)
        self._check(seen.steps)
        return seen

    def _check(self, raw: tuple[int, ...]) -> None:
        """See that no wheel has gone farther than it can: nothing on the line protects a number.

        A robot that stands has been put somewhere else and switched on: it counts on from there.
        """
        now: float = self.clock()
        most = _MOST * (now - self._counted) + _NEAR_ZERO
        if any(abs(wrapped(new - old, 16)) > most for new, old in zip(raw, self._raw, strict=True)):
            if self._steering or self._wanted != (0, 0) or self._told != (0, 0):
                raise GarbageError(f"counters went from {self._raw} to {raw} in so short a time")
            left, right = raw
            self._raw = left, right
        self._counted = now

    def _count(self, raw: tuple[int, ...]) -> None:
        """Count on; the robot's own counters have 16 bits and wrap."""
        left, right = raw
        self._steps[0] += wrapped(left - self._raw[0], 16)
        self._steps[1] += wrapped(right - self._raw[1], 16)
        self._raw = left, right

    def _counts(self) -> Pair:
        left, right = self._steps
        return round(left * _COUNTS), round(right * _COUNTS)

    def _begin(self) -> None:
        """Take the robot's counters for where they are."""
        self._rest()
        self._raw = self._read_steps()
        self._counted = self.clock()

    def _rest(self) -> None:
        self._steering = False
        self._wanted = 0, 0
        for wheel in self._wheels:
            wheel.speed = 0.0

    def _resume(self) -> bool:
        now = self._read_steps()
        reset = self._line.reset_seen or looks_reset(now, self._raw, _NEAR_ZERO)
        self._counted = self.clock()
        if reset:
            self._raw = now
        else:
            self._count(now)
        return reset


def _steps_a_second(speed: int) -> int:
    steps = round(speed * SPEED_UNIT / STEP)
    return max(-_TOP, min(_TOP, steps))
