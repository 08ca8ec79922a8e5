"""The position controller that an e-puck lacks: from where the wheels are to how fast they turn.

A stepper turns as fast as it is told at once and loses no step, so that speeds are all there is to
control. Each look at the counters gives the next speeds: they rise with the profile's acceleration,
and fall so that the wheel can stop at its target.
"""

from dataclasses import dataclass
from math import copysign, sqrt
from typing import Final

REACHED: Final = 1.5
"""Steps off the target at which a wheel counts as there."""

_SETTLE: Final = 0.06
"""Seconds in which the last steps are made, at least: so an answer that comes late does no harm."""

_LATE: Final = 2.0
"""Times the last look's age that the last steps may take."""

_CREEP: Final = 25.0
"""Steps a second of the slowest approach."""


@dataclass(slots=True)
class Servo:
    """A wheel on its way.

    Attributes:
        target: in steps.
        top: greatest speed, steps a second.
        acceleration: steps a second, each second.
        speed: that the motor was told last, steps a second.
    """

    target: float = 0.0
    top: float = 0.0
    acceleration: float = 1.0
    speed: float = 0.0

    def left_over(self, position: float) -> float:
        """Return the steps that are left to go."""
        return self.target - position

    def reached(self, position: float) -> bool:
        """Tell whether the wheel is there, and was told to stand: nobody steers it after that."""
        return self.speed == 0.0 and abs(self.left_over(position)) <= REACHED

    def steer(self, position: float, elapsed: float) -> float:
        """Return the next speed, steps a second.

        Args:
            position: steps that the counter reads.
            elapsed: seconds since the last speed was told.
        """
        left = self.left_over(position)
        if abs(left) <= REACHED:
            self.speed = 0.0
            return 0.0
        before = max(copysign(self.speed, self.speed * left), 0.0)
        wanted = min(
            self.top,
            before + self.acceleration * max(elapsed, 0.001),
            sqrt(2.0 * self.acceleration * abs(left)),
            abs(left) / max(_SETTLE, _LATE * elapsed),
        )
        self.speed = copysign(max(wanted, _CREEP), left)
        return self.speed
