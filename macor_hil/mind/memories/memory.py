"""The interface of memories."""

from typing import Protocol

import numpy as np

from macor_hil.arrays import Array, State
from macor_hil.mind.experience import Experience


class Memory(Protocol):
    """Learn from experience, and keep what planners read.

    A class of memories is made with those of the keywords `nodes` (n, the most situations),
    `commands` (m), `features` (M), `mirrored` (see `Eyes.mirrored`) and `directions` (see
    `FloorSeeing`; 0: the eyes do not tell) that its constructor has. All its other parameters are
    settings, with defaults.
    """

    def tune(self, x: Array, rng: np.random.Generator) -> None:
        """Prepare for what a first drive showed: features, shape (frames, M)."""
        ...

    def learn(self, experience: Experience) -> None:
        """Learn what a command led to."""
        ...

    def state(self) -> State:
        """Return everything that was learned, as named arrays."""
        ...

    def load(self, state: State) -> None:
        """Take over a stored state.

        Raises:
            ValueError, KeyError: it does not fit this memory.
        """
        ...
