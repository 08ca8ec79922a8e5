"""A robot as the driver drives it, whatever kind it is: wheels, counters, infrared sensors.

The units are those of the driver: counts of 0.08 mm, speeds in counts / 10 ms, infrared readings
from 0 far to 1023 near, from the left over the front to the back, as a Khepera has them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final, NamedTuple, Protocol, runtime_checkable

from macor_hil.arrays import Image
from macor_hil.hardware.line.line_statistics import Meter


class RobotKind(StrEnum):
    """Kinds of robots that can be driven; AUTO is whichever answers."""

    AUTO = "auto"
    KHEPERA = "khepera"
    EPUCK = "epuck"


@dataclass(frozen=True, slots=True)
class WheelStatus:
    """Status of one wheel.

    Attributes:
        reached: whether the target of the position controller is reached.
        speed_mode: whether the speed controller (or PWM) is in charge.
        error: control error in counts, or counts / 10 ms.
    """

    reached: bool
    speed_mode: bool
    error: int


FULL: Final = 1023
"""Greatest infrared reading in the driver's scale, in which 1000 is a white wall at 15 mm."""

FRONT_SENSORS: Final = slice(0, 6)
"""Infrared sensors that face where a robot can drive to: all but the two at the back."""


class Look(NamedTuple):
    """A look at a robot on its way.

    Attributes:
        proximity: the eight infrared sensors.
        elapsed: seconds since it set out, when they were read.
        wheels: left and right; None: they were not looked at.
    """

    proximity: tuple[int, ...]
    elapsed: float
    wheels: tuple[WheelStatus, WheelStatus] | None


class Robot(Protocol):
    """A robot on an open serial port.

    All methods that talk to it raise RobotError: no answer, another one, or a failed port.

    Attributes:
        kind: of the robot, which is never AUTO.
        clock: seconds on the clock that the port lives by: virtual for `khepera://`, else real.
        meter: counts requests and times their round trips on that clock.
    """

    kind: RobotKind
    clock: Callable[[], float]
    meter: Meter

    @property
    def top_speed(self) -> int:
        """Greatest speed of a wheel."""
        ...

    @property
    def port(self) -> Any:
        """The pySerial port; another one after a reconnection."""
        ...

    def connect(self) -> tuple[str, ...]:
        """Clear the line and ask for versions."""
        ...

    def halt(self) -> None:
        """Stop the robot, whatever an interrupted exchange has left on the line."""
        ...

    def recover(self, patience: float) -> bool:
        """Get the robot back within seconds; returns whether it had been reset."""
        ...

    def wait(self, seconds: float) -> None:
        """Let time pass on the port's clock."""
        ...

    def close(self) -> None:
        """Stop the robot as far as the line still allows, and close the port, once."""
        ...

    def set_speed(self, left: int, right: int) -> None:
        """Hold wheel speeds."""
        ...

    def stop(self) -> None:
        """Stand still."""
        ...

    def go_to(self, left: int, right: int) -> None:
        """Drive both wheels to counter values, along the profile."""
        ...

    def set_profile(self, left: tuple[int, int], right: tuple[int, int]) -> None:
        """Top speed and acceleration of each wheel on its way to a target."""
        ...

    def set_counters(self, left: int, right: int) -> None:
        """Set the counters of a robot that stands."""
        ...

    def counters(self) -> tuple[int, int]:
        """Return the counters, left and right."""
        ...

    def status(self) -> tuple[WheelStatus, WheelStatus]:
        """State of the motion, left and right."""
        ...

    def proximity(self) -> tuple[int, ...]:
        """Return the eight infrared sensors."""
        ...

    def battery(self) -> float | None:
        """Return the battery's voltage; None where the robot does not tell it."""
        ...


@runtime_checkable
class Seeing(Protocol):
    """A robot with a camera of its own, whose pictures come on its line."""

    clock: Callable[[], float]

    def picture(self) -> Image:
        """Take a picture: blue, green and red, shape (H, W, 3).

        Raises:
            RobotError: none came.
        """
        ...


@runtime_checkable
class Followed(Protocol):
    """A robot that may be in this process, where many looks are taken at once.

    Nobody could do anything between two of them, as time passes by looking alone.
    """

    def watch(self, limit: int, begin: float, seconds: float) -> tuple[int, ...]:
        """Return the sensors when one at the front reads so much, or a time has passed.

        Args:
            limit: counts.
            begin: on its clock.
            seconds: after that.
        """
        ...

    def follow(self, limit: int, begin: float, seconds: float, patience: float) -> Look:
        """Look until a sensor at the front reads so much, it is there, or patience is over.

        Args:
            limit: counts.
            begin: when it set out, on its clock.
            seconds: after which it should be there; wheels are not looked at before.
            patience: seconds beyond that.
        """
        ...


def looked(robot: Robot, limit: int, begin: float, seconds: float) -> Look:
    """Look once: at the sensors, and at the wheels once a robot should be there.

    Args:
        robot: on its way.
        limit: counts of a sensor at the front from which on wheels do not matter.
        begin: when it set out, on its clock.
        seconds: after which it should be there.
    """
    proximity = robot.proximity()
    elapsed = robot.clock() - begin
    seen = max(proximity[FRONT_SENSORS]) >= limit or elapsed < seconds
    return Look(proximity, elapsed, None if seen else robot.status())
