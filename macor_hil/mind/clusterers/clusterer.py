"""The interface of clusterers."""

from typing import Protocol

from macor_hil.arrays import Array, State
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
