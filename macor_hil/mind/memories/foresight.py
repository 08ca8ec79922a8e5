"""Memory of foresight: the last part of all drives, and the skill that was learned from it.

The skill is learned anew each time as much again has been experienced, later every 3,000 commands:
a second of work each time. Motions and collisions are those of the robot that drove, its drift and
its sensors included, and not of the arena: what was learned in one serves in others.
"""

from typing import Annotated, Final

import numpy as np
from pydantic import Field

from macor_hil.arrays import Array, State
from macor_hil.mind.experience import Experience
from macor_hil.mind.foresight.skill import Skill, learned_skill
from macor_hil.mind.memories.frames import Frames
from macor_hil.mind.stored import MOST_COUNTED, whole

_FIRST: Final = 125
"""Commands after which a skill is learned for the first time."""

_MOST: Final = 3_000


class ForesightMemory:
    """Memory of drives that knows what it takes to foresee others.

    Args:
        directions: of profiles; 0: the eyes do not tell where the floor ends, and nothing is
            learned.
        frames: how many of the last ones are kept and learned from.

    Attributes:
        skill: what was learned; None before.
    """

    def __init__(
        self, directions: int, frames: Annotated[int, Field(ge=250, le=100_000)] = _MOST
    ) -> None:
        self.skill: Skill | None = None
        self._frames = Frames(directions, frames)
        self._learned = 0

    def tune(self, x: Array, rng: np.random.Generator) -> None:
        """Prepare for nothing."""

    def learn(self, experience: Experience) -> None:
        """Keep an experience, and now and then learn what all of them show."""
        if not self._frames.add(experience):
            return
        self._learned += 1
        if _is_due(self._learned):
            self._learn_skill()

    def state(self) -> State:
        """Return the kept frames, and the skill."""
        known = self._frames.state() | {"learned": np.array([self._learned])}
        return known if self.skill is None else known | self.skill.state()

    def load(self, state: State) -> None:
        """Take over a stored state.

        Raises:
            ValueError, KeyError: something is missing, does not fit, or cannot have been seen.
        """
        (learned,) = whole(state, "learned", 0, MOST_COUNTED)
        self._frames.load(state)
        self._learned = int(learned)
        self.skill = Skill.of(state) if "motions" in state else None

    def _learn_skill(self) -> None:
        frames = self._frames
        skill = learned_skill(frames.profiles, frames.commands, frames.collided, frames.earned)
        # a stretch of a drive may show too little, and takes nothing away
        self.skill = skill or self.skill


def _is_due(learned: int) -> bool:
    if learned < _MOST:
        return learned % _FIRST == 0 and (learned // _FIRST).bit_count() == 1
    return learned % _MOST == 0
