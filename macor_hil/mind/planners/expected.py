"""Beyond the paper: outcomes weighed by how often they occurred.

The paper's planner takes the best outcome that a command ever had. Here a command in a situation
is worth the mean over its outcomes k', weighed by their counts,

    Q(k, a) = sum over k' of p(k' | k, a) * ( w^r + gamma * max over a' of Q(k', a') ),

which is the expected, discounted reinforcement (Bellman 1957). The counts of one situation are
pooled over the commands that led into it: what a command does hangs on where the robot is, not on
how it got there, and pooling gives every estimate m times the evidence. The paper mentions
"actual transition probabilities" as a variant that it gave up.
"""

from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from macor_hil.arrays import Array, Mask
from macor_hil.mind.experience import Moment
from macor_hil.mind.memories.transitions import SensorimotorMap, Transitions
from macor_hil.mind.planners.planner import Hypothesis, Plan, best_command, ranked
from macor_hil.mind.planners.value_iteration import iterate


class _Evaluated(NamedTuple):
    """Commands of all situations: chances of their outcomes, which were tried, and their worth."""

    chance: Array
    tried: Mask
    q: Array
    steps: int


class Expected:
    """Expected value over the counted outcomes; each step looks one command further ahead.

    Args:
        gamma: discount of what comes a command later.
        max_steps: steps at most; the evaluation may settle earlier.
        settled: change of the evaluations below which they count as settled.
    """

    memory = "transitions"

    def __init__(
        self,
        gamma: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.95,
        max_steps: Annotated[int, Field(ge=1)] = 200,
        settled: Annotated[float, Field(gt=0.0)] = 1e-4,
    ) -> None:
        self._gamma = gamma
        self._max_steps = max_steps
        self._settled = settled
        self._last: tuple[Transitions, _Evaluated] | None = None

    def plan(self, memory: SensorimotorMap, now: Moment) -> Plan:
        """Evaluate the commands that can follow the present neuron."""
        transitions, start = memory, now.neuron
        chance, tried, q, steps = self._evaluated(memory)
        node = start // transitions.commands
        evaluations = tuple(
            float(value) if known else None
            for value, known in zip(q[node], tried[node], strict=True)
        )
        command = best_command(evaluations)
        hypotheses = [
            Hypothesis(_likeliest(chance, q, tried, node, a), value)
            for a, value in enumerate(evaluations)
            if value is not None
        ]
        weighed = ranked(hypotheses, transitions.commands)
        return Plan(evaluations, command, weighed[0].neurons if weighed else (), steps, weighed)

    def _evaluated(self, memory: SensorimotorMap) -> _Evaluated:
        """Return what all commands are worth, which is the same until something is learned."""
        known = memory.transitions()
        if self._last is None or self._last[0] is not known:
            chance, r = pooled_outcomes(memory)
            tried: Mask = chance.sum(axis=2) > 0.0
            reward = (chance * r).sum(axis=2)
            q, steps = iterate(
                chance,
                reward,
                tried,
                gamma=self._gamma,
                max_steps=self._max_steps,
                settled=self._settled,
            )
            self._last = known, _Evaluated(chance, tried, q, steps)
        return self._last[1]


def _likeliest(chance: Array, q: Array, tried: Mask, node: int, a: int) -> tuple[int, ...]:
    """Return the likeliest sequence that begins with a command and goes on with the best ones.

    Given as neurons, to the first repetition.
    """
    commands = q.shape[1]
    sequence: list[int] = []
    seen: set[int] = set()
    while node not in seen and tried[node].any():
        seen.add(node)
        if sequence:
            a = int(np.where(tried[node], q[node], -np.inf).argmax())
        node = int(chance[node, a].argmax())
        sequence.append(node * commands + a)
    return tuple(sequence)


def pooled_outcomes(memory: SensorimotorMap) -> tuple[Array, Array]:
    """Return the outcomes of each command in each situation.

    Returns:
        p(k' | k, a), zero where the command was never tried, and the mean reinforcement of that
        outcome; both of shape (n, m, n), indexed [k, a, k'].
    """
    n, m = memory.nodes, memory.commands
    past, present, z, w_r, *_ = memory.transitions()
    # the command that led into the present situation of a plan does not matter
    where = past // m, present % m, present // m
    counts, sums = np.zeros((n, m, n)), np.zeros((n, m, n))
    np.add.at(counts, where, z)
    np.add.at(sums, where, z * w_r)
    total = counts.sum(axis=2, keepdims=True)
    chance = np.divide(counts, total, out=np.zeros_like(counts), where=total > 0)
    return chance, np.divide(sums, counts, out=np.zeros_like(counts), where=counts > 0)
