"""The sensorimotor map: transitions between situations, their competence and evaluation.

Neuron i = k * m + a stands for "situation k, entered by command a". A transition leads from the
preceding neuron j to the present neuron i; its command is i % m. Equations 1 and 2 of the paper.
Only transitions that occurred are kept, so that a map grows with what was experienced and not with
the square of its neurons.
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Competence:
    """Parameters of equation 1.

    Attributes:
        mu, sigma: a transition adapted mu times has half of the greatest weight.
        w_max: the greatest weight, below 1 so that activity shrinks with every transition.
    """

    mu: Annotated[float, Field(ge=-100.0, le=100.0)] = 2.8
    sigma: Annotated[float, Field(ge=0.2, le=1e3)] = 0.4
    w_max: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95

    def __call__(self, z: NDArray[np.int64] | np.int64) -> Array:
        """w^c of transitions adapted z times; 0 for those that never occurred.

        The printed exponent has the other sign; the text (a weight "can quickly reach a maximum
        value") decides.
        """
        weight: Array = self.w_max / (1.0 + np.exp(-(z - self.mu) / self.sigma))
        return np.where(z > 0, weight, 0.0)


class Transitions(NamedTuple):
    """All K transitions of a map, those of one preceding neuron side by side.

    Attributes:
        past, present: neurons j and i, shape (K,), in ascending order of j and then i.
        z: how often each was adapted.
        w_r: evaluations w^r_ij.
        w_c: competences w^c_ij (equation 1).
        first: place of the first transition of every preceding neuron, shape (n m + 1,).
    """

    past: Indices
    present: Indices
    z: Indices
    w_r: Array
    w_c: Array
    first: Indices

    def after(self, j: int) -> slice:
        """Where the transitions that begin at a neuron lie."""
        return slice(int(self.first[j]), int(self.first[j + 1]))


class SensorimotorMap:
    """Counts and evaluations of the transitions between n * m neurons.

    Attributes:
        nodes: n, situations.
        commands: m, commands of each situation.
        competence: parameters of equation 1.
    """

    def __init__(
        self,
        nodes: int,
        commands: int,
        competence: Competence = Competence(),
    ) -> None:
        self.nodes = nodes
        self.commands = commands
        self.competence = competence
        self._rows: dict[tuple[int, int], int] = {}
        self._z: list[int] = []
        self._since: list[int] = []
        self._w_r: list[float] = []
        self._sorted: Transitions | None = None

    def __len__(self) -> int:
        """Number of transitions that occurred."""
        return len(self._rows)

    @property
    def size(self) -> int:
        """Number of neurons."""
        return self.nodes * self.commands

    def neuron(self, node: int, command: int) -> int:
        """Neuron of a situation entered by a command."""
        return node * self.commands + command

    def learn(self, j: int, i: int, r: float) -> None:
        """Adapt the transition j -> i that earned the reinforcement r (equation 2)."""
        row = self._rows.setdefault((j, i), len(self._rows))
        if row == len(self._z):
            self._z.append(0)
            self._since.append(0)
            self._w_r.append(0.0)
        self._z[row] += 1
        self._since[row] += 1
        self._w_r[row] += (r - self._w_r[row]) / self._since[row]
        self._sorted = None

    def evaluation(self, j: int, i: int) -> float:
        """w^r_ij of a transition that occurred.

        Raises:
            KeyError: it never did.
        """
        return self._w_r[self._rows[j, i]]

    def begin_anew(self) -> None:
        """Let learning rates begin anew, because commands earn something else from now on.

        Evaluations stay until they are adapted; counts, and so competences, go on.
        """
        self._since = [0] * len(self._since)

    def transitions(self) -> Transitions:
        """All transitions, as arrays; made once and kept until something is learned."""
        if self._sorted is None:
            pairs = np.array(list(self._rows), dtype=np.int64).reshape(-1, 2)
            order = np.lexsort((pairs[:, 1], pairs[:, 0]))
            past, present = pairs[order].T
            z = np.array(self._z, dtype=np.int64)[order]
            self._sorted = Transitions(
                past,
                present,
                z,
                np.array(self._w_r, dtype=float)[order],
                self.competence(z),
                np.searchsorted(past, np.arange(self.size + 1)),
            )
        return self._sorted

    def load(self, present: Indices, past: Indices, z: Indices, w_r: Array) -> None:
        """Take over stored transitions: neurons, counts and evaluations, all of shape (K,).

        Raises:
            IndexError: a neuron is none of this map's.
        """
        neurons = np.concatenate([present, past])
        if neurons.size and not 0 <= neurons.min() <= neurons.max() < self.size:
            raise IndexError(f"a neuron is not between 0 and {self.size - 1}")
        pairs = zip(past.tolist(), present.tolist(), strict=True)
        self._rows = {pair: row for row, pair in enumerate(pairs)}
        self._z, self._w_r = z.tolist(), w_r.tolist()
        self._since = list(self._z)
        self._sorted = None
