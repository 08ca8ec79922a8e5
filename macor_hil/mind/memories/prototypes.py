"""Graded situations: how much an input belongs to each prototype, instead of to one node alone.

Fifty nodes cut what the robot sees into fifty pieces, and near the edge of a piece a little noise
makes another situation of the same place. Memberships that fall off smoothly with the distance to a
prototype say where between them an input lies (a softmax over distances, as in a mixture model).

Fuzzy ART takes its nodes where the first inputs happen to lie; when they are used up, the rest of
the world has none of its own. Prototypes are placed by k-means in what a first drive saw, and are
spread over all of it.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from macor_hil.arrays import Array

WIDTH = 0.5
"""Distance at which a membership has fallen to 1/e of the nearest prototype's, in the units of
Fuzzy ART's distance: summed over all features (a choice; 0.3 drives as well)."""

_ATTEMPTS = 3
_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)


def memberships(distances: Array, width: float = WIDTH) -> Array:
    """Return the memberships of one input by its distances, both of shape (n,); they sum to 1."""
    shares = np.exp((distances.min() - distances) / width)
    normed: Array = shares / shares.sum()
    return normed


@dataclass(frozen=True, slots=True, eq=False)
class Prototypes:
    """Places in the space of inputs that stand for graded situations.

    Attributes:
        centres: shape (n, M).
        width: see `WIDTH`.
    """

    centres: Array
    width: float = WIDTH

    def memberships(self, x: Array) -> Array:
        """Return how much an input of shape (M,) belongs to each prototype, shape (n,)."""
        return memberships(np.abs(self.centres - x).sum(axis=1), self.width)


def placed(inputs: Array, count: int, rng: np.random.Generator, width: float = WIDTH) -> Prototypes:
    """Prototypes in the middle of groups of inputs (k-means).

    Args:
        inputs: shape (T, M), at least one.
        count: n, how many; with fewer inputs some prototypes are equal.
        rng: of the first guesses.
        width: see `WIDTH`.
    """
    if len(inputs) < count:
        inputs = np.resize(inputs, (count, inputs.shape[1]))
    # OpenCV draws from a generator of its own, one a thread
    cv2.setRNGSeed(int(rng.integers(2**31)))
    start = np.zeros(len(inputs), dtype=np.int32)
    data = inputs.astype(np.float32)
    _, _, centres = cv2.kmeans(data, count, start, _STOP, _ATTEMPTS, cv2.KMEANS_PP_CENTERS)
    return Prototypes(np.asarray(centres, dtype=float), width)
