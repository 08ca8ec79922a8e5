"""Reinforcement: what a driven command earns.

The paper rewards "a collision free, straight navigation behavior": less for a turn than for
straight on, 0.0 for a collision. It does not print the two values, but table 1 bounds them: 0.61 a
step (collisions apart) for the reactive system, which mostly drives straight on, 0.55 for the
anticipative one, which mostly turns.
"""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from macor_hil.commands import MotorCommand
from macor_hil.mind.stored import MOST_EARNED

_Earned = Annotated[float, Field(ge=-MOST_EARNED, le=MOST_EARNED)]


@dataclass(frozen=True, slots=True)
class Reinforcement:
    """Earned by straight on, by a turn, and by a collision."""

    straight: _Earned = 0.62
    turn: _Earned = 0.54
    collision: _Earned = 0.0

    def __call__(self, command: MotorCommand, collided: bool) -> float:
        """Return what a command earned."""
        if collided:
            return self.collision
        return self.straight if command.turn == 0.0 else self.turn
