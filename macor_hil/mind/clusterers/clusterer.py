"""What every clusterer offers, and the clusterer error of figure 2."""

from typing import Protocol

import numpy as np

from macor_hil.arrays import Array, Indices, State
from macor_hil.mind.experience import Resonance


class Clusterer(Protocol):
    """A network whose nodes are visual situations.

    A class of clusterers is made with those of the keywords `features` (M) and `nodes` (n, the most
    nodes) that its constructor has. All its other parameters are settings, with defaults.
    """

    @property
    def size(self) -> int:
        """Number of nodes in use."""
        ...

    def present(self, x: Array, learn: bool = True) -> Resonance:
        """Find the situation of an input of shape (M,), and learn it unless told otherwise."""
        ...

    def centres(self) -> Array:
        """Middle of the inputs that each node stands for, shape (size, M)."""
        ...

    def state(self) -> State:
        """Return what was learned, as named arrays."""
        ...

    def load(self, state: State) -> None:
        """Take over a stored state.

        Raises:
            ValueError, KeyError: it does not fit this clusterer.
        """
        ...


def situations(clusterer: Clusterer, inputs: Array, *, learn: bool) -> Indices:
    """Present inputs of shape (T, M) in their order; the node of each, shape (T,)."""
    return np.array([clusterer.present(x, learn=learn).node for x in inputs], dtype=np.int64)


def clusterer_errors(clusterer: Clusterer, inputs: Array) -> Array:
    """Euclidean distance from each input to the middle of the node that it is taken for.

    The measure of figure 2, the same for all clusterers: shape (T,) for inputs of shape (T, M).
    Nothing is learned.
    """
    nodes = situations(clusterer, inputs, learn=False)
    errors: Array = np.linalg.norm(inputs - clusterer.centres()[nodes], axis=1)
    return errors
