"""Neural Gas, the statistical clusterer that the paper compares with (section 3.1).

Martinetz and Schulten (1991), in their symbols: each input x adapts all nodes by their rank k in
the order of distance (the nearest has k = 0),

    w <- w + epsilon * exp(-k / lambda) * (x - w),

while epsilon and lambda fall from an initial to a final value,

    epsilon(t) = epsilon_i * (epsilon_f / epsilon_i) ** (t / t_max),

lambda likewise. The paper prints no parameters; they were "determined offline on a data set using
a breadth search for the combination yielding the smallest clusterer error": see `search`.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from typing import Annotated

import numpy as np
from pydantic import Field

from macor_hil.arrays import Array, Indices, State
from macor_hil.mind.clusterers.clusterer_error import clusterer_errors
from macor_hil.mind.experience import Resonance
from macor_hil.mind.stored import MOST_COUNTED, numbers, whole

_NEGLIGIBLE = 9.0
"""Radii beyond which a node is left alone: exp(-9) is 0.0001."""


@dataclass(frozen=True, slots=True)
class Annealing:
    """Schedule of learning rate and radius.

    Attributes:
        rate: epsilon at the first and the last step.
        radius: lambda at the first and the last step, in ranks.
        steps: t_max; later steps keep the last values.
    """

    rate: tuple[float, float] = (0.5, 0.005)
    radius: tuple[float, float] = (10.0, 0.01)
    steps: int = 65_500

    def at(self, t: int) -> tuple[float, float]:
        """Return epsilon and lambda after t steps."""
        done = min(t / self.steps, 1.0)
        first, last = self.rate
        widest, narrowest = self.radius
        return first * (last / first) ** done, widest * (narrowest / widest) ** done


class NeuralGas:
    """A Neural Gas whose nodes are visual situations; all of them are in use from the beginning.

    Args:
        features: M, the length of x.
        nodes: n.
        annealing: how learning rate and radius fall.
        seed: of the first weights, drawn evenly from [0, 1]^M.
    """

    def __init__(
        self,
        features: int,
        nodes: int,
        annealing: Annealing = Annealing(),
        seed: Annotated[int, Field(ge=0)] = 0,
    ) -> None:
        self.features = features
        self.annealing = annealing
        self.steps = 0
        self._weights = np.random.default_rng(seed).random((nodes, features))
        self._ranks = -np.arange(nodes)

    @property
    def size(self) -> int:
        """Number of nodes n."""
        return len(self._weights)

    @property
    def weights(self) -> Array:
        """Weights w of all nodes, shape (n, M)."""
        return self._weights

    def present(self, x: Array, learn: bool = True) -> Resonance:
        """Find the nearest node of an input, and adapt all of them unless told otherwise.

        There is no vigilance, so every input resonates. The match is that of Fuzzy ART for a box
        that is a single point: 1 - |x - w| / M.

        Args:
            x: features, shape (M,), each in [0, 1].
            learn: adapt, and count a step of the annealing.
        """
        apart, distance = self._distances(x)
        nearest = int(distance.argmin())
        match = 1.0 - float(np.abs(apart[nearest]).sum()) / self.features
        if learn:
            self._adapt(apart, distance)
        return Resonance(nearest, True, match)

    def learn_all(self, inputs: Array) -> None:
        """Adapt to inputs of shape (T, M) in their order, as `present` does."""
        for x in inputs:
            self._adapt(*self._distances(x))

    def situations_of(self, inputs: Array) -> Indices:
        """Return the nearest node of each input of shape (T, M), shape (T,); nothing is learned."""
        _, distance = self._distances(inputs)
        nodes: Indices = distance.argmin(axis=1)
        return nodes

    def centres(self) -> Array:
        """Return the weights: a node is a point, shape (n, M)."""
        return self._weights

    def state(self) -> State:
        """Return the weights, and how many steps have been taken."""
        return {"weights": self._weights, "steps": np.array([self.steps])}

    def load(self, state: State) -> None:
        """Take over stored weights of shape (n, M).

        Raises:
            ValueError, KeyError: they are missing or do not fit.
        """
        self._weights = numbers(state, "weights", self._weights.shape, -10.0, 10.0)
        (steps,) = whole(state, "steps", 0, MOST_COUNTED).tolist()
        self.steps = steps

    def _distances(self, x: Array) -> tuple[Array, Array]:
        """Return what separates inputs from each node, shape (..., n, M), and its square."""
        apart = x[..., None, :] - self._weights
        return apart, np.einsum("...f,...f->...", apart, apart)

    def _adapt(self, apart: Array, distance: Array) -> None:
        epsilon, radius = self.annealing.at(self.steps)
        self.steps += 1
        adapted = min(int(_NEGLIGIBLE * radius) + 1, self.size)
        if adapted == 1:
            nearest = distance.argmin()
            self._weights[nearest] += epsilon * apart[nearest]
            return
        order = distance.argsort(kind="stable")[:adapted]
        strength = np.zeros((self.size, 1))
        strength[order, 0] = epsilon * np.exp(self._ranks[:adapted] / radius)
        apart *= strength
        self._weights += apart


@dataclass(frozen=True, slots=True)
class Breadth:
    """Values of the breadth search, which tries every combination.

    Attributes:
        rate_first, rate_last: epsilon at the first and the last step.
        radius_first, radius_last: lambda at the first and the last step.
    """

    rate_first: tuple[float, ...] = (0.1, 0.3, 0.6)
    rate_last: tuple[float, ...] = (0.005, 0.02, 0.05)
    radius_first: tuple[float, ...] = (2.0, 5.0, 10.0)
    radius_last: tuple[float, ...] = (0.1,)

    def annealings(self, steps: int) -> list[Annealing]:
        """Return all combinations, for a training of a number of steps."""
        rates = product(self.rate_first, self.rate_last)
        radii = product(self.radius_first, self.radius_last)
        return [Annealing(rate, radius, steps) for rate, radius in product(rates, radii)]


def trained(
    inputs: Array, nodes: int, annealing: Annealing, presentations: int = 1, seed: int = 0
) -> NeuralGas:
    """Train a Neural Gas by so many presentations of inputs of shape (T, M)."""
    gas = NeuralGas(inputs.shape[1], nodes, annealing, seed)
    for _ in range(presentations):
        gas.learn_all(inputs)
    return gas


def search(
    inputs: Array,
    nodes: int,
    annealings: Iterable[Annealing],
    presentations: int = 1,
    seed: int = 0,
) -> Annealing:
    """Search for the annealing that ends with the smallest mean clusterer error.

    Args:
        inputs: data set, shape (T, M).
        nodes: n.
        annealings: what to try; the first of equals is taken.
        presentations: how often each presents the whole data set.
        seed: of the first weights.
    """

    def error(annealing: Annealing) -> float:
        gas = trained(inputs, nodes, annealing, presentations, seed)
        return float(clusterer_errors(gas, inputs).mean())

    return min(annealings, key=error)
