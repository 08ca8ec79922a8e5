"""The clusterer error of figure 2, the same measure for all clusterers."""

from typing import Final, Protocol, runtime_checkable

import numpy as np

from macor_hil.arrays import Array, Indices
from macor_hil.mind.clusterers.clusterer import Clusterer

_FEW: Final = 64
"""Inputs at once, for which what is computed on the way fits into the processor's cache."""


def situations(clusterer: Clusterer, inputs: Array, *, learn: bool) -> Indices:
    """Present inputs of shape (T, M) in their order; the node of each, shape (T,)."""
    return np.array([clusterer.present(x, learn=learn).node for x in inputs], dtype=np.int64)


@runtime_checkable
class Sorting(Protocol):
    """A clusterer that finds the situations of many inputs at once, learning nothing."""

    def situations_of(self, inputs: Array) -> Indices:
        """Return the node of each input of shape (T, M), shape (T,)."""
        ...


def _nodes(clusterer: Clusterer, inputs: Array) -> Indices:
    if not isinstance(clusterer, Sorting):
        return situations(clusterer, inputs, learn=False)
    few = (inputs[k : k + _FEW] for k in range(0, max(len(inputs), 1), _FEW))
    return np.concatenate([clusterer.situations_of(some) for some in few])


def clusterer_errors(clusterer: Clusterer, inputs: Array) -> Array:
    """Euclidean distance from each input to the middle of the node that it is taken for.

    The measure of figure 2, the same for all clusterers: shape (T,) for inputs of shape (T, M).
    Nothing is learned.
    """
    nodes = _nodes(clusterer, inputs)
    errors: Array = np.linalg.norm(inputs - clusterer.centres()[nodes], axis=1)
    return errors
