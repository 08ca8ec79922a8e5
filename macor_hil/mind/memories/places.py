"""Memory of places: all that was seen and driven, kept for goals that come later.

Nothing is learned from it before a planner asks for the atlas (`foresight.chart`), which takes
some seconds; it depends on no goal.
"""

from collections import deque
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from macor_hil.arrays import Array, State
from macor_hil.commands import COMMANDS
from macor_hil.mind.experience import Experience, Moment
from macor_hil.mind.eyes.sights import CHANNELS, SECTORS
from macor_hil.mind.foresight.chart.atlas import Atlas, atlas_of
from macor_hil.mind.foresight.skill import Skill
from macor_hil.mind.stored import MOST_EARNED, numbers, whole

_PUT_DOWN: Final = -1
_MOST: Final = 30_000
_NEAREST: Final = 8.0
_LEVELS: Final = 255


class _Frame(NamedTuple):
    """A view, in few bytes, and what led to it."""

    profile: NDArray[np.float16]
    sights: NDArray[np.uint8]
    command: int = _PUT_DOWN
    collided: bool = False
    earned: float = 0.0


class PlacesMemory:
    """Memory of the views of all drives, with the commands between them.

    Args:
        directions: of profiles; 0: the eyes do not tell where the floor ends, and nothing is kept.
        frames: how many of the last ones are kept.
    """

    def __init__(
        self, directions: int, frames: Annotated[int, Field(ge=250, le=80_000)] = _MOST
    ) -> None:
        self._directions = directions
        self._frames: deque[_Frame] = deque(maxlen=frames)
        self._atlas: Atlas | None = None

    def tune(self, x: Array, rng: np.random.Generator) -> None:
        """Prepare for nothing."""

    def learn(self, experience: Experience) -> None:
        """Keep an experience."""
        start, after = _frame(experience.before), _frame(experience.after)
        if not self._directions or start is None or after is None:
            return
        if not self._frames or (self._frames[-1].profile != start.profile).any():
            self._frames.append(start)
        self._frames.append(
            after._replace(
                command=experience.command,
                collided=experience.collided,
                earned=experience.reinforcement,
            )
        )
        self._atlas = None

    @property
    def atlas(self) -> Atlas | None:
        """The atlas of everything that is kept; None: too little. Some seconds the first time."""
        if self._atlas is None and self._frames:
            state = self.state()
            self._atlas = atlas_of(
                state["profiles"].astype(np.float64),
                self.sights,
                state["commands"].astype(np.int64),
                state["collided"].astype(np.bool_),
                state["earned"],
            )
        return self._atlas

    @property
    def skill(self) -> Skill | None:
        """The robot's skill, which foresight reads; None: too little was seen."""
        return None if self.atlas is None else self.atlas.skill

    @property
    def profiles(self) -> Array:
        """Profiles of the views, shape (T, directions)."""
        profiles = np.array([f.profile for f in self._frames], np.float64)
        return profiles.reshape(len(profiles), self._directions)

    @property
    def sights(self) -> Array:
        """Sights of the views, 0 to 1, shape (T, 24, 5)."""
        sights = np.array([f.sights for f in self._frames], np.float64) / _LEVELS
        return sights.reshape(len(sights), SECTORS, len(CHANNELS))

    def state(self) -> State:
        """Return the kept views."""
        count = len(self._frames)
        profiles = np.array([f.profile for f in self._frames], np.float16)
        sights = np.array([f.sights for f in self._frames], np.uint8)
        return {
            "profiles": profiles.reshape(count, self._directions),
            "sights": sights.reshape(count, SECTORS, len(CHANNELS)),
            "commands": np.array([f.command for f in self._frames], np.int8),
            "collided": np.array([f.collided for f in self._frames], np.int8),
            "earned": np.array([f.earned for f in self._frames], np.float64),
        }

    def load(self, state: State) -> None:
        """Take over a stored state.

        Raises:
            ValueError, KeyError: something is missing, does not fit, or cannot have been seen.
        """
        profiles = numbers(state, "profiles", (None, self._directions), 0.0, _NEAREST)
        commands = whole(state, "commands", _PUT_DOWN, len(COMMANDS) - 1)
        collided = whole(state, "collided", 0, 1)
        earned = numbers(state, "earned", (None,), -MOST_EARNED, MOST_EARNED)
        sights = state["sights"]
        if sights.dtype != np.uint8 or sights.shape != (len(profiles), SECTORS, len(CHANNELS)):
            raise ValueError(f"sights is of {sights.dtype} and shape {sights.shape}")
        if not len(profiles) == len(commands) == len(collided) == len(earned):
            raise ValueError("it has not as many profiles as commands")
        if len(profiles) and profiles.min() <= 0.0:
            raise ValueError("a profile ends nowhere")
        kept = profiles.astype(np.float16), sights, commands.tolist(), collided.tolist()
        rows = zip(*kept, earned.tolist(), strict=True)
        self._frames.clear()
        self._frames.extend(_Frame(p, s, c, bool(h), r) for p, s, c, h, r in rows)
        self._atlas = None


def _frame(moment: Moment) -> _Frame | None:
    """Return what is kept of a moment; None: its eyes do not tell."""
    if moment.floor is None or moment.sights is None:
        return None
    sights = np.rint(moment.sights * _LEVELS).astype(np.uint8)
    return _Frame(moment.floor.astype(np.float16), sights)
