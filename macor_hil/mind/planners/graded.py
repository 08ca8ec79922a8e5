"""Beyond the paper: expected value over graded situations.

The robot is in several situations at once, in each as much as the input belongs to it
(`clustering.membership`). With b the memberships now,

    Q(k, a) = r(k, a) + gamma * sum over k' of p(k' | k, a) * max over a' of Q(k', a'),
    value of a = sum over k of b_k * Q(k, a).

That is value iteration on representative states with interpolation between them (kernel-based
reinforcement learning: Ormoneit and Sen 2002, Kveton and Theocharous 2012), here with Fuzzy ART's
nodes as the states. Two places that share a nearest node are told apart by their other memberships,
which is what the paper's planners fail by.
"""

from typing import Annotated

import numpy as np
from pydantic import Field

from macor_hil.arrays import Array
from macor_hil.mind.experience import Moment
from macor_hil.mind.memories.graded import DOUBT, GradedMap, GradedMemory
from macor_hil.mind.planners.planner import Hypothesis, Plan, best_command, ranked
from macor_hil.mind.planners.value_iteration import iterate

_LONGEST = 12
"""Situations of a hypothetical sequence at most."""


class Graded:
    """Expected value between the nodes; each step looks one command further ahead.

    Args:
        gamma: discount of what comes a command later.
        max_steps: steps at most; the evaluation may settle earlier.
        settled: change of the evaluations below which they count as settled.
        doubt: see `memories.graded.DOUBT`.
        memory: name of the memory of graded situations that it reads.
    """

    def __init__(
        self,
        gamma: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.95,
        max_steps: Annotated[int, Field(ge=1)] = 300,
        settled: Annotated[float, Field(gt=0.0)] = 1e-4,
        doubt: Annotated[float, Field(ge=0.0)] = DOUBT,
        memory: str = "graded",
    ) -> None:
        self.memory = memory
        self._last: tuple[tuple[GradedMap, int], tuple[Array, Array, int]] | None = None
        self._gamma = gamma
        self._max_steps = max_steps
        self._settled = settled
        self._doubt = doubt

    def plan(self, memory: GradedMemory, now: Moment) -> Plan:
        """Evaluate the commands that can follow the present moment."""
        graded, b = memory.counts, memory.memberships(now.features)
        chance, q, steps = self._evaluated(graded)
        tried = b @ graded.tried > 0.0
        values = b @ q
        evaluations = tuple(
            float(value) if known else None for value, known in zip(values, tried, strict=True)
        )
        hypotheses = ranked(
            (
                Hypothesis(_course(graded, chance, q, b, a), value)
                for a, value in enumerate(evaluations)
                if value is not None
            ),
            graded.commands,
        )
        sequence = hypotheses[0].neurons if hypotheses else ()
        return Plan(evaluations, best_command(evaluations), sequence, steps, hypotheses)

    def _evaluated(self, graded: GradedMap) -> tuple[Array, Array, int]:
        """Return chances, what all commands are worth, and steps; the same until it is counted."""
        state = graded, graded.counted
        if self._last is None or self._last[0] != state:
            chance, reward = graded.outcomes(self._doubt)
            q, steps = iterate(
                chance,
                reward,
                np.ones_like(reward, dtype=bool),  # an untried command is worth its doubt
                gamma=self._gamma,
                max_steps=self._max_steps,
                settled=self._settled,
            )
            self._last = state, (chance, q, steps)
        return self._last[1]


def _course(graded: GradedMap, chance: Array, q: Array, b: Array, a: int) -> tuple[int, ...]:
    """Follow a command and then the best ones: the strongest situations, as neurons."""
    neurons: list[int] = []
    while len(neurons) < _LONGEST:
        b = b @ chance[:, a]
        if b.sum() < 0.5:  # a collision is likelier by now
            break
        neurons.append(int(b.argmax()) * graded.commands + a)
        a = int((b @ q).argmax())
    return tuple(neurons) or (int(b.argmax()) * graded.commands + a,)
