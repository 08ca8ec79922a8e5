"""Fuzzy ART with fast learning, and the paper's cap on the number of nodes (section 2.1).

Carpenter, Grossberg and Rosen (1991), in the paper's symbols: x features in [0, 1]^M, I = (x, 1-x)
the complement-coded input, w_k weights of node k, ^ the element-wise minimum, |.| the sum.
"""

from typing import Annotated, Final

import numpy as np
from pydantic import Field

from macor_hil.arrays import Array, Indices, State
from macor_hil.mind.experience import Resonance
from macor_hil.mind.stored import numbers

_EMPTY: Final = "an empty network can only learn"


class FuzzyArt:
    """A Fuzzy ART network whose nodes are visual situations.

    Args:
        features: M, the length of x.
        nodes: n, the most nodes there can be.
        vigilance: rho in [0, 1]; a node represents inputs with |I ^ w| / M >= rho.
        alpha: choice parameter; small values prefer small boxes.
    """

    def __init__(
        self,
        features: int,
        nodes: int,
        vigilance: Annotated[float, Field(ge=0.0, le=1.0)] = 0.9,
        alpha: Annotated[float, Field(ge=1e-9, le=1e3)] = 0.001,
    ) -> None:
        self.features = features
        self.nodes = nodes
        self.vigilance = vigilance
        self.alpha = alpha
        self.size = 0
        self._weights = np.ones((nodes, 2 * features))
        self._sums = np.full(nodes, 2.0 * features)

    @property
    def weights(self) -> Array:
        """Weights w_k of the nodes in use, shape (size, 2 M)."""
        return self._weights[: self.size]

    def state(self) -> State:
        """Return the weights of the nodes in use."""
        return {"weights": self.weights}

    def load(self, state: State) -> None:
        """Take over stored weights of shape (size, 2 M).

        Raises:
            ValueError, KeyError: they are missing or do not fit.
        """
        weights = numbers(state, "weights", (None, 2 * self.features), 0.0, 1.0)
        if len(weights) > self.nodes:
            raise ValueError(f"there are weights of {len(weights)} nodes, and {self.nodes} at most")
        self.size = len(weights)
        self._weights[: self.size] = weights
        self._sums[: self.size] = weights.sum(axis=1)

    def present(self, x: Array, learn: bool = True) -> Resonance:
        """Find the situation of an input, and learn it unless told otherwise.

        Args:
            x: features, shape (M,), each in [0, 1].
            learn: fast learning, w_k <- I ^ w_k, and a new node for what nothing resonates with.

        Raises:
            ValueError: nothing has been learned yet and nothing may be.
        """
        coded = np.concatenate([x, 1.0 - x])
        size = self.size
        if size == 0:
            if not learn:
                raise ValueError(_EMPTY)
            return self._add(coded)
        common = np.minimum(coded, self._weights[:size])
        overlap = common.sum(axis=1)  # |I ^ w_k|
        sums = self._sums[:size]  # |w_k|
        passed = overlap >= self.vigilance * self.features
        if passed.any():
            # the search visits nodes by descending choice T_k until one matches: the best of those
            choice = np.where(passed, overlap / (self.alpha + sums), -1.0)
            k = int(choice.argmax())
            if learn:
                self._weights[k] = common[k]
                self._sums[k] = overlap[k]
            return Resonance(k, True, float(overlap[k] / self.features))
        if learn and size < self.nodes:
            return self._add(coded)
        # no free node: the nearest box stands for the input and does not learn
        k = int((sums - overlap).argmin())
        return Resonance(k, False, float(overlap[k] / self.features))

    def situations_of(self, inputs: Array) -> Indices:
        """Return the node of each input of shape (T, M), shape (T,); nothing is learned.

        Raises:
            ValueError: nothing has been learned yet.
        """
        if self.size == 0:
            raise ValueError(_EMPTY)
        coded = np.concatenate([inputs, 1.0 - inputs], axis=1)
        overlap = np.minimum(coded[:, None], self.weights).sum(axis=2)
        sums = self._sums[: self.size]
        passed = overlap >= self.vigilance * self.features
        choice = np.where(passed, overlap / (self.alpha + sums), -1.0).argmax(axis=1)
        nodes: Indices = np.where(passed.any(axis=1), choice, (sums - overlap).argmin(axis=1))
        return nodes

    def distances(self, x: Array) -> Array:
        """Return an input's distance from each node's box, |w_k| - |I ^ w_k|, shape (size,)."""
        coded = np.concatenate([x, 1.0 - x])
        overlap: Array = np.minimum(coded, self.weights).sum(axis=1)
        return self._sums[: self.size] - overlap

    def centres(self) -> Array:
        """Middle (w_u + (1 - w_v)) / 2 of each node's box, shape (size, M)."""
        lower, upper = self.weights[:, : self.features], 1.0 - self.weights[:, self.features :]
        middle: Array = (lower + upper) / 2
        return middle

    def _add(self, coded: Array) -> Resonance:
        k = self.size
        self._weights[k] = coded
        self._sums[k] = coded.sum()
        self.size += 1
        return Resonance(k, True, 1.0)
