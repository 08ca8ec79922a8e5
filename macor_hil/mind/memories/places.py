"""Memory of places: all that was seen and driven, kept for goals that come later.

Nothing is learned from it before a planner asks for the atlas (`foresight.chart`), which takes
some seconds; it depends on no goal.
"""

from collections import deque
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from macor_hil.arrays import Array, State
from macor_hil.mind.experience import Experience
from macor_hil.mind.eyes.sights import CHANNELS, SECTORS
from macor_hil.mind.foresight.chart.atlas import Atlas, atlas_of
from macor_hil.mind.foresight.skill import Skill
from macor_hil.mind.memories.frames import Frames

_MOST: Final = 30_000
_LEVELS: Final = 255


class PlacesMemory:
    """Memory of the views of all drives, with the commands between them.

    Args:
        directions: of profiles; 0: the eyes do not tell where the floor ends, and nothing is kept.
        frames: how many of the last ones are kept.
    """

    def __init__(
        self, directions: int, frames: Annotated[int, Field(ge=250, le=80_000)] = _MOST
    ) -> None:
        self._frames = Frames(directions, frames)
        # those of the frames, one for each
        self._sights: deque[NDArray[np.uint8]] = deque(maxlen=frames)
        self._atlas: Atlas | None = None
        self._is_known = False

    def tune(self, x: Array, rng: np.random.Generator) -> None:
        """Prepare for nothing."""

    def learn(self, experience: Experience) -> None:
        """Keep an experience."""
        before, after = experience.before.sights, experience.after.sights
        if before is None or after is None:
            return
        if count := self._frames.add(experience):
            self._sights.extend(
                np.rint(each * _LEVELS).astype(np.uint8) for each in (before, after)[-count:]
            )
            self._is_known = False

    @property
    def atlas(self) -> Atlas | None:
        """The atlas of everything that is kept; None: too little. Some seconds the first time."""
        if not self._is_known:
            frames, self._is_known = self._frames, True
            self._atlas = (
                atlas_of(
                    frames.profiles, self.sights, frames.commands, frames.collided, frames.earned
                )
                if len(frames)
                else None
            )
        return self._atlas

    @property
    def skill(self) -> Skill | None:
        """The robot's skill, which foresight reads; None: too little was seen."""
        return None if self.atlas is None else self.atlas.skill

    @property
    def profiles(self) -> Array:
        """Profiles of the views, shape (T, directions)."""
        return self._frames.profiles

    @property
    def sights(self) -> Array:
        """Sights of the views, 0 to 1, shape (T, 24, 5)."""
        return self._stored_sights() / _LEVELS

    def state(self) -> State:
        """Return the kept views."""
        state = dict(self._frames.state())
        return {"profiles": state.pop("profiles"), "sights": self._stored_sights(), **state}

    def load(self, state: State) -> None:
        """Take over a stored state.

        Raises:
            ValueError, KeyError: something is missing, does not fit, or cannot have been seen.
        """
        sights = state["sights"]
        if sights.dtype != np.uint8 or sights.shape[1:] != (SECTORS, len(CHANNELS)):
            raise ValueError(f"sights is of {sights.dtype} and shape {sights.shape}")
        if len(sights) != len(state["profiles"]):
            raise ValueError("it has not as many sights as profiles")
        self._frames.load(state)
        self._sights.clear()
        self._sights.extend(sights)
        self._is_known = False

    def _stored_sights(self) -> NDArray[np.uint8]:
        sights = np.array(self._sights, np.uint8)
        return sights.reshape(len(sights), SECTORS, len(CHANNELS))
