"""The sensorimotor map: transitions between situations, their competence and evaluation.

Neuron i = k * m + a stands for "situation k, entered by command a". A transition leads from the
preceding neuron j to the present neuron i; its command is i % m. Equations 1 and 2 of the paper.
Only transitions that occurred are kept, so that a map grows with what was experienced and not with
the square of its neurons.
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from macor_hil.arrays import Array, Indices, State
from macor_hil.mind.experience import Experience
from macor_hil.mind.stored import MOST_COUNTED, MOST_EARNED, numbers, whole


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

    def __call__(self, z: Indices | np.int64) -> Array:
        """Return w^c of transitions adapted z times; 0 for those that never occurred.

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
        """Return the places of the transitions that begin at a neuron."""
        return slice(int(self.first[j]), int(self.first[j + 1]))


class SensorimotorMap:
    """Memory of the paper's map: counts and evaluations of transitions between n * m neurons.

    Attributes:
        nodes: n, situations.
        commands: m, commands of each situation.
        competence: parameters of equation 1.
    """

    most = MOST_EARNED
    """Greatest evaluation, either way, that is loaded."""

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
        """Return the number of transitions that occurred."""
        return len(self._rows)

    @property
    def size(self) -> int:
        """Number of neurons."""
        return self.nodes * self.commands

    def neuron(self, node: int, command: int) -> int:
        """Neuron of a situation entered by a command."""
        return node * self.commands + command

    def tune(self, x: Array, rng: np.random.Generator) -> None:
        """Prepare for nothing: neurons are what they are."""

    def learn(self, experience: Experience) -> None:
        """Adapt the transition between the neurons of an experience."""
        self.adapt(experience.before.neuron, experience.after.neuron, experience.reinforcement)

    def adapt(self, j: int, i: int, r: float) -> None:
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
        """Return w^r_ij of a transition that occurred.

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
        """Return all transitions, as arrays; made once and kept until something is learned."""
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

    def state(self) -> State:
        """Return the K transitions: neurons, counts and evaluations, each of shape (K,)."""
        known = self.transitions()
        return {
            "past": known.past.astype(np.int32),
            "present": known.present.astype(np.int32),
            "z": known.z,
            "w_r": known.w_r,
        }

    def load(self, state: State) -> None:
        """Take over stored transitions.

        Raises:
            ValueError, KeyError: something is missing, does not fit, or cannot have been learned.
        """
        past, present = (whole(state, name, 0, self.size - 1) for name in ("past", "present"))
        z = whole(state, "z", 1, MOST_COUNTED)
        w_r = numbers(state, "w_r", (None,), -self.most, self.most)
        if not past.shape == present.shape == z.shape == w_r.shape:
            raise ValueError("it has not as many neurons as counts and evaluations")
        pairs = list(zip(past.tolist(), present.tolist(), strict=True))
        self._rows = {pair: row for row, pair in enumerate(pairs)}
        if len(self._rows) != len(pairs):
            raise ValueError("it has a transition twice")
        self._z, self._w_r = z.tolist(), w_r.tolist()
        self._since = list(self._z)
        self._sorted = None
