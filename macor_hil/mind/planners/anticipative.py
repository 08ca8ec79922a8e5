"""MACOR's planner: a wave of activity through the map, evaluations running back (section 2.4).

The reading of equations 5 and 6: within one planning episode every neuron holds one activity, the
greatest that reaches it, and hangs on the predecessor from which that activity came. A sequence
therefore never visits a neuron twice, and the wave ends by itself because every transition
takes activity away. Evaluations run back along exactly these links, so that a command is worth

    y^b_j = max over i hanging on j of ( w^r_ij * y^a_i + y^b_i ).

Both can be stopped after any number of wave steps; the decision gets better with each.
"""

from typing import Annotated

import numpy as np
from pydantic import Field

from macor_hil.arrays import Array, Indices
from macor_hil.mind.experience import Moment
from macor_hil.mind.memories.transitions import SensorimotorMap, Transitions
from macor_hil.mind.planners.planner import Hypothesis, Plan, best_command, best_ends, ranked


class Anticipative:
    """Parallel search for the best sequence of transitions.

    Args:
        max_steps: wave steps at most; None lets the wave run out.
        threshold: activity below which a neuron does not pass it on.
    """

    memory = "transitions"

    def __init__(
        self,
        max_steps: Annotated[int, Field(ge=1)] | None = None,
        threshold: Annotated[float, Field(ge=0.0, lt=1.0)] = 1e-3,
    ) -> None:
        self._max_steps = max_steps
        self._threshold = threshold

    def plan(self, memory: SensorimotorMap, now: Moment) -> Plan:
        """Evaluate the commands that can follow the present neuron."""
        start, commands = now.neuron, memory.commands
        known = memory.transitions()
        y_a, steps = self._spread(known, start)
        weighed, successor = _run_back(known, y_a, start)
        best, firsts = best_ends(weighed, commands)
        evaluations = tuple(best)
        command = best_command(evaluations)
        first = -1 if command is None else firsts[command]
        if first == start:
            first = -1  # no sequence meets a neuron twice, the start neither
        return Plan(
            evaluations,
            command,
            _sequence(first, successor),
            steps,
            ranked(
                (Hypothesis(_sequence(i, successor), value) for i, value in weighed),
                commands,
            ),
            tuple(y_a.tolist()),
        )

    def _spread(self, known: Transitions, start: int) -> tuple[Array, int]:
        """Return the greatest activity of every neuron, and the wave steps it took (equation 5)."""
        y_a = np.zeros(len(known.first) - 1)
        y_a[start] = 1.0
        front: Indices = np.array([start])
        steps = 0
        while front.size and (self._max_steps is None or steps < self._max_steps):
            # only neurons whose activity has just risen have something new to pass on
            edges = _edges_after(known, front)
            reached = y_a.copy()
            passed = known.w_c[edges] * y_a[known.past[edges]]
            np.maximum.at(reached, known.present[edges], passed)
            risen = np.flatnonzero(reached > y_a)
            steps += bool(risen.size)
            y_a = reached
            front = risen[y_a[risen] >= self._threshold]
        return y_a, steps


def _edges_after(known: Transitions, front: Indices) -> Indices:
    """Return the places of all transitions that begin at some neurons."""
    begin, counts = known.first[front], known.first[front + 1] - known.first[front]
    ends = np.cumsum(counts)
    places: Indices = np.arange(ends[-1]) + np.repeat(begin - ends + counts, counts)
    return places


def _run_back(
    known: Transitions, y_a: Array, start: int
) -> tuple[list[tuple[int, float]], dict[int, int]]:
    """Return direct successors of the start with their worth, and the best links (equation 6)."""
    hangs = known.w_c * y_a[known.past] == y_a[known.present]
    links = np.flatnonzero(hangs & (y_a[known.present] > 0.0) & (known.present != start))
    # from the weakest neuron to the strongest: each is complete before it hands on
    links = links[np.argsort(y_a[known.present[links]], kind="stable")]
    earned = known.w_r[links] * y_a[known.present[links]]
    y_b: dict[int, float] = {}
    successor: dict[int, int] = {}
    own = known.after(start)
    # staying in the same situation by the same command is worth one step
    weighed = [
        (start, float(known.w_r[place] * known.w_c[place]))
        for place in own.start + np.flatnonzero(known.present[own] == start)
    ]
    for j, i, r in zip(
        known.past[links].tolist(), known.present[links].tolist(), earned.tolist(), strict=True
    ):
        value = r + y_b.get(i, 0.0)
        if j == start:
            weighed.append((i, value))
        elif j not in successor or value > y_b[j]:
            y_b[j], successor[j] = value, i
    return weighed, successor


def _sequence(first: int, successor: dict[int, int]) -> tuple[int, ...]:
    """Return a neuron and its best continuation; empty for none (-1)."""
    neurons: list[int] = []
    following: int | None = first if first >= 0 else None
    while following is not None:
        neurons.append(following)
        following = successor.get(following)
    return tuple(neurons)
