"""The clusterer error of figure 2, the same measure for all clusterers."""

import numpy as np

from macor_hil.arrays import Array, Indices
from macor_hil.mind.clusterers.clusterer import Clusterer


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
