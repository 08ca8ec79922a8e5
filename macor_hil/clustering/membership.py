"""Graded situations: how much an input belongs to each node, instead of to the nearest one alone.

Fifty nodes cut what the robot sees into fifty pieces, and near the edge of a piece a little noise
makes another situation of the same place. Memberships that fall off smoothly with the distance to a
node say where between the nodes an input lies (a softmax over distances, as in a mixture model).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WIDTH = 0.5
"""Distance at which a membership has fallen to 1/e of that of a node that holds the input, in the
units of Fuzzy ART's distance: summed over all features (a choice: 0.2 and 1.0 did worse in arenas
never trained in)."""


def memberships(distances: Array, nodes: int, width: float = WIDTH) -> Array:
    """Memberships of one input, shape (nodes,); they sum to 1.

    Args:
        distances: from the input to each node in use, shape (size,), at least one.
        nodes: how many nodes there can be; those not in use get 0.
        width: see `WIDTH`.
    """
    shares = np.exp((distances.min() - distances) / width)
    all_shares: Array = np.zeros(nodes)
    all_shares[: len(distances)] = shares / shares.sum()
    return all_shares
