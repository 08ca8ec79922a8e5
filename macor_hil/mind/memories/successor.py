"""The successor representation of situations and commands.

A pair i = k * m + a stands for "command a chosen in situation k". The representation M_ij is how
often pair j is expected to be driven from pair i on, discounted, with the best commands after it:

    M_i <- M_i + eta * ( 1_i + gamma * M_i' - M_i ),   i' = the best pair of the situation after it,
    Q(k, a) = sum over j of M_ij * r_j,

with 1_i the vector that is 1 at i and 0 elsewhere, and r_j the mean reinforcement of pair j
(Dayan 1993; with the best commands in place of those that were driven as in Russek, Momennejad,
Botvinick, Gershman and Daw 2017, SR-TD). Nothing follows a collision.

Values are learned as by Q-learning, from one experience at a time and without a model that could be
asked for hypothetical sequences; but where a command leads and what it earns are kept apart, so
that other rewards change all values at once. It lies between Q-learning and the planners that
simulate, on the same situations.
"""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from macor_hil.arrays import Array, Mask, State
from macor_hil.mind.experience import Experience
from macor_hil.mind.stored import MOST_COUNTED, MOST_EARNED, numbers, whole

_ROUNDING = 1e-4
"""By which sums in single precision may exceed what they are sums of."""


class SuccessorMap:
    """Memory of what follows commands in situations, and of what they earn.

    Args:
        nodes: n, situations.
        commands: m, commands of each situation.
        gamma: discount of what comes a command later.
        rate: least learning rate eta; the first experiences of a pair are averaged (1 / z).

    Attributes:
        follows: M, shape (n m, n m).
        tried: how often each pair was driven, shape (n m,).
        earned: mean reinforcement of each pair, shape (n m,).
    """

    def __init__(
        self,
        nodes: int,
        commands: int,
        gamma: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.9,
        rate: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1,
    ) -> None:
        self.commands = commands
        self._gamma = gamma
        self._rate = rate
        pairs = nodes * commands
        self.follows: NDArray[np.float32] = np.zeros((pairs, pairs), np.float32)
        self.tried = np.zeros(pairs, np.int64)
        self.earned = np.zeros(pairs)

    def tune(self, x: Array, rng: np.random.Generator) -> None:
        """Prepare for nothing: pairs are what they are."""

    def learn(self, experience: Experience) -> None:
        """Adapt the pair of an experience."""
        i = experience.before.node * self.commands + experience.command
        self.tried[i] += 1
        self.earned[i] += (experience.reinforcement - self.earned[i]) / self.tried[i]
        target = np.zeros(len(self.tried), np.float32)
        if not experience.collided:
            values, tried = self.values(experience.after.node)
            if tried.any():
                best = int(np.where(tried, values, -np.inf).argmax())
                follows = self.follows[experience.after.node * self.commands + best]
                target = np.float32(self._gamma) * follows
        target[i] += 1.0
        eta = np.float32(max(self._rate, 1.0 / self.tried[i]))
        self.follows[i] += eta * (target - self.follows[i])

    def values(self, node: int) -> tuple[Array, Mask]:
        """Return Q of each command in a situation, and the commands that were tried there."""
        pairs = slice(node * self.commands, (node + 1) * self.commands)
        return self.follows[pairs] @ self.earned, self.tried[pairs] > 0

    def state(self) -> State:
        """Return the representation, counts and mean reinforcements."""
        return {"follows": self.follows, "tried": self.tried, "earned": self.earned}

    def load(self, state: State) -> None:
        """Take over a stored state.

        Raises:
            ValueError, KeyError: something is missing, does not fit, or cannot have been learned.
        """
        pairs, longest = len(self.tried), (1.0 + _ROUNDING) / (1.0 - self._gamma)
        follows = numbers(state, "follows", (pairs, pairs), 0.0, longest)
        tried = whole(state, "tried", 0, MOST_COUNTED)
        earned = numbers(state, "earned", (pairs,), -MOST_EARNED, MOST_EARNED)
        if len(tried) != pairs:
            raise ValueError("it has not as many counts as situations and commands")
        if (follows.sum(axis=1) > longest).any():
            raise ValueError("more follows a command than discounting leaves")
        self.follows, self.tried, self.earned = follows.astype(np.float32), tried, earned
