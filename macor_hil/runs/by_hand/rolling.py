"""Velocities, each for a moment: a robot that is told nothing more comes to rest by itself.

A velocity is driven as a short way ahead, to whose end the position controller of the robot brings
it within the time limit: also if this program has been killed, or its cable pulled. The next
velocity moves the end on before it is near. With acceleration a and speed v, a way of v (T - v / a)
takes T from rest, and less from any speed up to v.
"""

from typing import Final

from khepera_protocol.serial.units import ACCELERATION_UNIT, CONTROL_PERIOD, SPEED_UNIT

from macor_hil.hardware.driver import DriveSettings, is_touching
from macor_hil.hardware.khepera import Khepera

LIMIT: Final = 0.5
"""Seconds after a velocity within which the robot stands, if no other one comes."""

FASTEST: Final = 25
"""Counts / 10 ms: the fastest that leaves room to brake within the limit."""

_DRIVEN: Final = 0.34
"""Seconds of the limit for the drive itself; the rest is for the requests on the line."""

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

    def __init__(self, robot: Khepera, settings: DriveSettings) -> None:
        self._robot = robot
        self._settings = settings
        self._top = min(settings.speed, FASTEST)
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
        share = min(1.0, self._top / fastest)
        speeds = [way * share for way in ways]
        top = max(map(abs, speeds))
        braking = top * SPEED_UNIT / (_ACCELERATION * ACCELERATION_UNIT)
        seconds = max(_DRIVEN - braking, 0.0)
        profiles = [
            (max(1, round(abs(speed))), max(1, round(_ACCELERATION * abs(speed) / top)))
            for speed in speeds
        ]
        here = self._robot.counters()
        self._robot.set_profile(profiles[0], profiles[1])
        self._robot.go_to(
            *(
                counts + round(speed * seconds / CONTROL_PERIOD)
                for counts, speed in zip(here, speeds, strict=True)
            )
        )

    def stop(self) -> None:
        """Stand still.

        Raises:
            RobotError: the robot does not answer.
        """
        self._robot.stop()
        self._ahead = False

    def look(self) -> tuple[int, ...]:
        """Return the infrared readings; a robot that is about to touch something ahead is stopped.

        Raises:
            RobotError: the robot does not answer.
        """
        proximity = self._robot.proximity()
        self._touching = is_touching(proximity, self._settings)
        if self._touching and self._ahead:
            self.stop()
        return proximity
