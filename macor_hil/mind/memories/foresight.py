"""Memory of foresight: the last part of all drives, and the skill that was learned from it.

The skill is learned anew each time as much again has been experienced, later every 3,000 commands:
a second of work each time, done when somebody asks for the skill. Motions and collisions are those
of the robot that drove, its drift and its sensors included, and not of the arena: what was learned
in one serves in others.
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

_MOST_WAITING: Final = 8
"""Stretches of a drive that wait at most until a skill is learned from one: 1.5 MB each."""


class ForesightMemory:
    """Memory of drives that knows what it takes to foresee others.

    Args:
        directions: of profiles; 0: the eyes do not tell where the floor ends, and nothing is
            learned.
        frames: how many of the last ones are kept and learned from.

    """

    def __init__(
        self, directions: int, frames: Annotated[int, Field(ge=250, le=100_000)] = _MOST
    ) -> None:
        self._skill: Skill | None = None
        self._frames = Frames(directions, frames)
        self._learned = 0
        self._waiting: list[Frames] = []

    @property
    def skill(self) -> Skill | None:
        """The skill that was learned; None before."""
        while self._waiting:
            seen = self._waiting.pop()
            skill = learned_skill(seen.profiles, seen.commands, seen.collided, seen.earned)
            # a stretch of a drive may show too little, and takes nothing away
            if skill is not None:
                self._skill = skill
                self._waiting.clear()
        return self._skill

    def tune(self, x: Array, rng: np.random.Generator) -> None:
        """Prepare for nothing."""

    def learn(self, experience: Experience) -> None:
        """Keep an experience, and now and then learn what all of them show."""
        if not self._frames.add(experience):
            return
        self._learned += 1
        if _is_due(self._learned):
            self._waiting.append(self._frames.copy())
            if len(self._waiting) > _MOST_WAITING:
                _ = self.skill

    def state(self) -> State:
        """Return the kept frames, and the skill."""
        known = self._frames.state() | {"learned": np.array([self._learned])}
        skill = self.skill
        return known if skill is None else known | skill.state()

    def load(self, state: State) -> None:
        """Take over a stored state.

        Raises:
            ValueError, KeyError: something is missing, does not fit, or cannot have been seen.
        """
        (learned,) = whole(state, "learned", 0, MOST_COUNTED)
        self._frames.load(state)
        self._learned = int(learned)
        self._skill = Skill.of(state) if "motions" in state else None
        self._waiting.clear()


def _is_due(learned: int) -> bool:
    if learned < _MOST:
        return learned % _FIRST == 0 and (learned // _FIRST).bit_count() == 1
    return learned % _MOST == 0
