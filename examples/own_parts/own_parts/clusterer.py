"""The leader algorithm (Hartigan 1975): an input far from every leader becomes one itself."""

from typing import Annotated

import numpy as np
from pydantic import Field

from macor_hil.arrays import Array, State
from macor_hil.mind.experience import Resonance


class Leader:
    """Situations are inputs that came first; nothing moves afterwards.

    Args:
        features: M.
        nodes: n, the most leaders.
        distance: mean difference of features, 0 to 1, from which on an input leads itself.
    """

    def __init__(
        self,
        features: int,
        nodes: int,
        distance: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1,
    ) -> None:
        self._nodes = nodes
        self._distance = distance
        self._leaders = np.empty((0, features))

    @property
    def size(self) -> int:
        """Number of leaders."""
        return len(self._leaders)

    def present(self, x: Array, learn: bool = True) -> Resonance:
        """Find the nearest leader of an input of shape (M,), or make it one."""
        if not self.size and not learn:
            raise ValueError("there are no leaders yet")
        apart = np.abs(self._leaders - x).mean(axis=1)
        near = bool(self.size) and float(apart.min()) < self._distance
        if learn and not near and self.size < self._nodes:
            self._leaders = np.concatenate([self._leaders, x[None]])
            return Resonance(self.size - 1, True, 1.0)
        k = int(apart.argmin())
        return Resonance(k, near, 1.0 - float(apart[k]))

    def centres(self) -> Array:
        """Return the leaders, shape (size, M)."""
        return self._leaders

    def state(self) -> State:
        """Return the leaders."""
        return {"leaders": self._leaders}

    def load(self, state: State) -> None:
        """Take over stored leaders."""
        leaders = np.asarray(state["leaders"], float)
        if leaders.ndim != 2 or leaders.shape[1:] != self._leaders.shape[1:]:
            raise ValueError(f"leaders of shape {leaders.shape} do not fit")
        self._leaders = leaders[: self._nodes]
