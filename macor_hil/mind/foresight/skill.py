"""A robot's skill: what its commands do, how near it may come, and what that earns; learned."""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from macor_hil.arrays import Array, Indices, Mask, State
from macor_hil.commands import COMMANDS
from macor_hil.mind.foresight.collisions import Curve, learned_curve
from macor_hil.mind.foresight.motions import learned_motion
from macor_hil.mind.stored import MOST_EARNED, numbers

_FARTHEST: Final = 4.0
"""Heights of the camera that a command drives at most, and radians that it turns."""

_CURVE: Final = (10.0, 10.0, 10.0)
_LEAST_VAGUE: Final = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Skill:
    """Everything that foresight is learned of.

    Attributes:
        motions: of each command: ahead, to the left, turned to the left; shape (m, 3).
        curve: chance of a collision by clearance.
        earns: reinforcement of each command that gets through, shape (m,).
        collision: reinforcement of one that does not.
    """

    motions: Array
    curve: Curve
    earns: Array
    collision: float

    def state(self) -> State:
        """Return it as arrays."""
        curve = self.curve
        return {
            "motions": self.motions,
            "curve": np.array([curve.reach, curve.vague, curve.grows]),
            "earns": np.array([*self.earns, self.collision]),
        }

    @classmethod
    def of(cls, state: State) -> Self:
        """Return the skill of a stored state.

        Raises:
            ValueError, KeyError: it is none.
        """
        commands = len(COMMANDS)
        motions = numbers(state, "motions", (commands, 3), -_FARTHEST, _FARTHEST)
        reach, vague, grows = numbers(state, "curve", (3,), 0.0, max(_CURVE)).tolist()
        if vague < _LEAST_VAGUE:
            raise ValueError("the curve of collisions has no spread")
        *earns, collision = numbers(state, "earns", (commands + 1,), -MOST_EARNED, MOST_EARNED)
        return cls(motions, Curve(reach, vague, grows), np.array(earns), float(collision))


def learned_skill(
    profiles: Array, commands: Indices, collided: Mask, earned: Array
) -> Skill | None:
    """Return the skill that a drive shows; None: it shows too little.

    Args:
        profiles: of every frame, shape (T, directions).
        commands: index of the command that led to each frame, negative where none did, shape (T,).
        collided: whether it ended in a collision, shape (T,).
        earned: what it earned, shape (T,).
    """
    motions, earns = [], []
    for command in range(len(COMMANDS)):
        through = 1 + np.flatnonzero((commands[1:] == command) & ~collided[1:])
        motion = learned_motion(profiles[through - 1], profiles[through])
        if motion is None:
            return None
        motions.append(motion)
        earns.append(float(earned[through].mean()))
    curve = learned_curve(profiles, commands, collided, np.array(motions))
    if curve is None:
        return None
    hit = float(earned[collided & (commands >= 0)].mean())
    skill = Skill(np.array(motions), curve, np.array(earns), hit)
    try:  # what could not be read again is not learned
        return Skill.of(skill.state())
    except ValueError:
        return None
