"""The sensorimotor map: transitions between situations, their competence and evaluation.

Neuron i = k * m + a stands for "situation k, entered by command a". A transition leads from the
preceding neuron j to the present neuron i; its command is i % m. Equations 1 and 2 of the paper.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Competence:
    """Parameters of equation 1.

    Attributes:
        mu, sigma: a transition adapted mu times has half of the greatest weight.
        w_max: the greatest weight, below 1 so that activity shrinks with every transition.
    """

    mu: float = 2.8
    sigma: float = 0.4
    w_max: float = 0.95

    def __call__(self, z: NDArray[np.int64] | np.int64) -> Array:
        """w^c of transitions adapted z times; 0 for those that never occurred.

        The printed exponent has the other sign; the text (a weight "can quickly reach a maximum
        value") decides.
        """
        weight: Array = self.w_max / (1.0 + np.exp(-(z - self.mu) / self.sigma))
        return np.where(z > 0, weight, 0.0)


class SensorimotorMap:
    """Counts and evaluations of all transitions between n * m neurons.

    Attributes:
        nodes: n, situations.
        commands: m, commands of each situation.
        z: how often each transition was adapted, shape (n m, n m), row i present, column j past.
        w_r: evaluation w^r_ij of each transition, same shape.
        w_c: competence w^c_ij of each transition (equation 1), same shape.
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
        size = nodes * commands
        self.z = np.zeros((size, size), dtype=np.int64)
        self.w_r = np.zeros((size, size))
        self.w_c = np.zeros((size, size))

    @property
    def size(self) -> int:
        """Number of neurons."""
        return self.nodes * self.commands

    def neuron(self, node: int, command: int) -> int:
        """Neuron of a situation entered by a command."""
        return node * self.commands + command

    def learn(self, j: int, i: int, r: float) -> None:
        """Adapt the transition j -> i that earned the reinforcement r (equation 2)."""
        self.z[i, j] += 1
        self.w_r[i, j] += (r - self.w_r[i, j]) / self.z[i, j]
        self.w_c[i, j] = self.competence(self.z[i, j])

    def load(self, present: Indices, past: Indices, z: Indices, w_r: Array) -> None:
        """Take over stored transitions: neurons, counts and evaluations, all of shape (K,)."""
        self.z[present, past] = z
        self.w_r[present, past] = w_r
        self.w_c = self.competence(self.z)
