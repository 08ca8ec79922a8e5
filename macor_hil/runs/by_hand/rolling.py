"""Velocities, each for a moment: a robot that is told nothing more is stopped, and comes to rest.

A velocity is driven as a short way ahead, to whose end the robot's own position controller brings
it. While somebody looks on, it is stopped before that, when the velocity is old; the end of the way
stops it where nobody can any more, because the program was killed or the cable pulled. The next
velocity moves the end on before it is near.
"""

from math import inf
from typing import Final

from khepera_protocol.serial.units import CONTROL_PERIOD

from macor_hil.hardware.driver import DriveSettings, is_touching
from macor_hil.hardware.robots.robot import Robot

LIMIT: Final = 0.5
"""Seconds after a velocity within which the robot stands, if no other one comes."""

_LASTS: Final = 0.25
"""Seconds for which a velocity holds; the rest of the limit is for a look, a stop and its way."""

_LEASH: Final = 0.6
"""Seconds of driving to the end of the way that a velocity is driven as."""

_ACCELERATION: Final = 255
"""In units of the command J: the greatest."""

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
        self._ends = inf
        self._ahead = False
        self._touching = False

    def go(self, forward: float, turning: float) -> None:
        """Drive at a velocity, for a moment; one that would go on into something is a stop.

        Args:
            forward: m/s; both are made smaller together where a wheel would be too fast.
            turning: rad/s, to the left.

        Raises:
            RobotError: the robot does not answer.
        """
        ways = self._settings.wheels.counts(forward * CONTROL_PERIOD, turning * CONTROL_PERIOD)
        fastest = max(map(abs, ways))
        self._ahead = forward > 0.0
        if fastest < _SMALLEST or (self._ahead and self._touching):
            self.stop()
            return
        share = min(1.0, self._settings.speed / fastest)
        speeds = [way * share for way in ways]
        top = max(map(abs, speeds))
        profiles = [
            (max(1, round(abs(speed))), max(1, round(_ACCELERATION * abs(speed) / top)))
            for speed in speeds
        ]
        here = self._robot.counters()
        self._robot.set_profile(profiles[0], profiles[1])
        self._robot.go_to(
            *(
                counts + round(speed * _LEASH / CONTROL_PERIOD)
                for counts, speed in zip(here, speeds, strict=True)
            )
        )
        self._ends = self._robot.clock() + _LASTS

    def stop(self) -> None:
        """Stand still.

        Raises:
            RobotError: the robot does not answer.
        """
        self._ends, self._ahead = inf, False
        self._robot.stop()

    def watch(self) -> None:
        """Stop a robot whose velocity is old; between any two requests to it.

        Raises:
            RobotError: the robot does not answer.
        """
        if self._robot.clock() > self._ends:
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
