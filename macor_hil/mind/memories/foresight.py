"""Memory of foresight: the last part of all drives, and the skill that was learned from it.

The skill is learned anew each time as much again has been experienced, later every 3,000 commands:
a second of work each time. Motions and collisions are those of the robot that drove, its drift and
its sensors included, and not of the arena: what was learned in one serves in others.
"""

from collections import deque
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from macor_hil.arrays import Array, State
from macor_hil.commands import COMMANDS
from macor_hil.mind.experience import Experience
from macor_hil.mind.foresight.skill import Skill, learned_skill
from macor_hil.mind.stored import MOST_COUNTED, MOST_EARNED, numbers, whole

_PUT_DOWN: Final = -1
_FIRST: Final = 125
"""Commands after which a skill is learned for the first time."""

_MOST: Final = 3_000

_NEAREST: Final = 8.0


class _Frame(NamedTuple):
    """A profile, in half precision, and what led to it."""

    profile: NDArray[np.float16]
    command: int = _PUT_DOWN
    collided: bool = False
    earned: float = 0.0


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
        self._directions = directions
        self._frames: deque[_Frame] = deque(maxlen=frames)
        self._learned = 0

    def tune(self, x: Array, rng: np.random.Generator) -> None:
        """Prepare for nothing."""

    def learn(self, experience: Experience) -> None:
        """Keep an experience, and now and then learn what all of them show."""
        before, after = experience.before.floor, experience.after.floor
        if not self._directions or before is None or after is None:
            return
        start = _Frame(before.astype(np.float16))
        if not self._frames or (self._frames[-1].profile != start.profile).any():
            self._frames.append(start)
        profile, earned = after.astype(np.float16), experience.reinforcement
        self._frames.append(_Frame(profile, experience.command, experience.collided, earned))
        self._learned += 1
        if _is_due(self._learned):
            self._learn_skill()

    def state(self) -> State:
        """Return the kept frames, and the skill."""
        profiles = np.array([f.profile for f in self._frames], np.float16)
        known: State = {
            "profiles": profiles.reshape(len(profiles), self._directions),
            "commands": np.array([f.command for f in self._frames], np.int8),
            "collided": np.array([f.collided for f in self._frames], np.int8),
            "earned": np.array([f.earned for f in self._frames], np.float64),
            "learned": np.array([self._learned]),
        }
        return known if self.skill is None else known | self.skill.state()

    def load(self, state: State) -> None:
        """Take over a stored state.

        Raises:
            ValueError, KeyError: something is missing, does not fit, or cannot have been seen.
        """
        profiles = numbers(state, "profiles", (None, self._directions), 0.0, _NEAREST)
        commands = whole(state, "commands", _PUT_DOWN, len(COMMANDS) - 1)
        collided = whole(state, "collided", 0, 1)
        earned = numbers(state, "earned", (None,), -MOST_EARNED, MOST_EARNED)
        (learned,) = whole(state, "learned", 0, MOST_COUNTED)
        if not len(profiles) == len(commands) == len(collided) == len(earned):
            raise ValueError("it has not as many profiles as commands")
        if len(profiles) and profiles.min() <= 0.0:
            raise ValueError("a profile ends nowhere")
        rows = zip(profiles, commands.tolist(), collided.tolist(), earned.tolist(), strict=True)
        self._frames.clear()
        self._frames.extend(_Frame(p.astype(np.float16), c, bool(h), r) for p, c, h, r in rows)
        self._learned = int(learned)
        self.skill = Skill.of(state) if "motions" in state else None

    def _learn_skill(self) -> None:
        frames = list(self._frames)
        skill = learned_skill(
            np.array([f.profile for f in frames], float),
            np.array([f.command for f in frames]),
            np.array([f.collided for f in frames]),
            np.array([f.earned for f in frames]),
        )
        # a stretch of a drive may show too little, and takes nothing away
        self.skill = skill or self.skill


def _is_due(learned: int) -> bool:
    if learned < _MOST:
        return learned % _FIRST == 0 and (learned // _FIRST).bit_count() == 1
    return learned % _MOST == 0
