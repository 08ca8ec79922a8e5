"""Velocities, each for a moment: a robot that is told nothing more is stopped, and comes to rest.

A velocity is driven as a short way ahead, to whose end the robot's own position controller brings
it. While somebody looks on, that end moves on with the robot, and a robot whose velocity is old is
stopped. Where nobody can stop it any more, because the program was killed or the cable pulled, it
comes to rest at the end of the way.
"""

from math import inf
from typing import Final

from khepera_protocol.serial.units import CONTROL_PERIOD

from macor_hil.hardware.driver import DriveSettings, counts_within, is_touching
from macor_hil.hardware.robots.robot import Robot

LIMIT: Final = 0.5
"""Seconds within which the robot stands after a velocity, if no other one comes, and after the
program's end, however that comes."""

ALONE: Final = 0.36
"""Seconds that the way ahead takes at most; the rest of the limit is for the line, and for wheels
to settle."""

_LASTS: Final = 0.2
"""Seconds for which a velocity holds; the rest of the limit is for a look, a stop and its way."""

_LEFT: Final = 0.3
"""Seconds that the way ahead takes at most beyond the end of its velocity: a program that is held
up need not even stop the robot."""

_ACCELERATION: Final = 240
"""In units of the command J. At the greatest, 255, wheels come to rest with a longer quiver."""

_FASTEST: Final = 16
"""Counts / 10 ms, 12.8 cm/s. A faster robot would have to brake on that way before it moves on: at
9600 baud that is after 0.13 s."""

_SMALLEST: Final = 0.5
"""Counts / 10 ms that are no motion."""


class Rolling:
    """Drives a robot by velocities.

    Args:
        robot: it.
        settings: its wheels, its greatest speed, and the infrared reading that counts as touching.
    """

    def __init__(self, robot: Robot, settings: DriveSettings) -> None:
        self._robot = robot
        self._settings = settings
        self._top = min(settings.speed, _FASTEST)
        self._speeds = (0.0, 0.0)
        self._ends = -inf
        self._profiles: tuple[tuple[int, int], tuple[int, int]] | None = None
        self._ahead = False
        self._touching = False

    def go(self, forward: float, turning: float) -> None:
        """Drive at a velocity from the next `roll` on, for a moment.

        One that would go on into something is a stop.

        Args:
            forward: m/s; both are made smaller together where a wheel would be too fast.
            turning: rad/s, to the left.

        Raises:
            RobotError: the robot does not answer.
        """
        left, right = self._settings.wheels.counts(
            forward * CONTROL_PERIOD, turning * CONTROL_PERIOD
        )
        fastest = max(abs(left), abs(right))
        self._ahead = forward > 0.0
        if fastest < _SMALLEST or (self._ahead and self._touching):
            self.stop()
            return
        share = min(1.0, self._top / fastest)
        self._speeds = left * share, right * share
        self._ends = self._robot.clock() + _LASTS

    def roll(self) -> tuple[int, int]:
        """Drive on as far as a velocity holds, and return the counters.

        Raises:
            RobotError: the robot does not answer.
        """
        self.watch()
        here = self._robot.counters()
        if self._ends == -inf:
            return here
        left, right = self._speeds
        top = max(abs(left), abs(right))
        profiles = _profile(left, top), _profile(right, top)
        if profiles != self._profiles:
            self._robot.set_profile(*profiles)
            self._profiles = profiles
        seconds = min(ALONE, self._ends + _LEFT - self._robot.clock())
        way = counts_within(max(1, round(top)), _ACCELERATION, seconds)
        self._robot.go_to(here[0] + round(left / top * way), here[1] + round(right / top * way))
        return here

    def stop(self) -> None:
        """Stand still.

        Raises:
            RobotError: the robot does not answer.
        """
        self._ends, self._ahead = -inf, False
        self._robot.stop()

    def watch(self) -> None:
        """Stop a robot whose velocity is old; between any two requests to it.

        Raises:
            RobotError: the robot does not answer.
        """
        if -inf < self._ends < self._robot.clock():
            self.stop()

    def look(self) -> tuple[int, ...]:
        """Return the infrared readings; a robot that is about to touch something ahead is stopped.

        Raises:
            RobotError: the robot does not answer.
        """
        proximity = self._robot.proximity()
        self._touching = is_touching(proximity, self._settings)
        if self._touching and self._ahead:
            self.stop()
        self.watch()
        return proximity


def _profile(speed: float, top: float) -> tuple[int, int]:
    """Return speed and acceleration of a wheel that arrives together with a faster one."""
    return max(1, round(abs(speed))), max(1, round(_ACCELERATION * abs(speed) / top))
