"""MACOR's planner: a wave of activity through the map, evaluations running back (section 2.4).

The reading of equations 5 and 6: within one planning episode every neuron holds one activity, the
greatest that reaches it, and hangs on the predecessor from which that activity came. A sequence
therefore never visits a neuron twice, and the wave ends by itself because every transition
takes activity away. Evaluations run back along exactly these links, so that a command is worth

    y^b_j = max over i hanging on j of ( w^r_ij * y^a_i + y^b_i ).

Both can be stopped after any number of wave steps; the decision gets better with each.
"""

import numpy as np
from numpy.typing import NDArray

from macor_hil.memory import Memory
from macor_hil.planners.planner import Hypothesis, Now, Plan, best_command, ranked
from macor_hil.sensorimotor_map import Array


class Anticipative:
    """Parallel search for the best sequence of transitions.

    Args:
        max_steps: wave steps at most; None lets the wave run out.
        threshold: activity below which a neuron does not pass it on.
    """

    def __init__(self, max_steps: int | None = None, threshold: float = 1e-3) -> None:
        self._max_steps = max_steps
        self._threshold = threshold

    def plan(self, memory: Memory, now: Now) -> Plan:
        """Evaluate the commands that can follow the present neuron."""
        transitions, start = memory.map, now.neuron
        w_c = transitions.w_c
        y_a, links, steps = self._spread(w_c, start)
        y_b = np.zeros(transitions.size)
        successor = np.full(transitions.size, -1)
        best: list[float | None] = [None] * transitions.commands
        firsts = [-1] * transitions.commands
        weighed: list[tuple[int, float]] = []
        if w_c[start, start] > 0.0:
            a = start % transitions.commands
            back = float(transitions.w_r[start, start] * w_c[start, start])
            best[a] = back
            weighed.append((start, back))
        # from the weakest neuron to the strongest: each is complete before it hands on
        for i in np.flatnonzero(links.any(axis=1))[np.argsort(y_a[links.any(axis=1)])]:
            for j in np.flatnonzero(links[i]):
                value = transitions.w_r[i, j] * y_a[i] + y_b[i]
                if j == start:
                    a = i % transitions.commands
                    known = best[a]
                    weighed.append((int(i), float(value)))
                    if known is None or value > known:
                        best[a], firsts[a] = float(value), int(i)
                elif successor[j] < 0 or value > y_b[j]:
                    y_b[j], successor[j] = value, i
        evaluations = tuple(best)
        command = best_command(evaluations)
        first = -1 if command is None else firsts[command]
        return Plan(
            evaluations,
            command,
            _sequence(first, successor),
            steps,
            ranked(
                (Hypothesis(_sequence(i, successor), value) for i, value in weighed),
                transitions.commands,
            ),
            tuple(y_a.tolist()),
        )

    def _spread(self, w_c: Array, start: int) -> tuple[Array, Array, int]:
        """Equation 5: greatest activity of every neuron, its links, and the steps it took."""
        y_a = np.zeros(len(w_c))
        y_a[start] = 1.0
        steps = 0
        while self._max_steps is None or steps < self._max_steps:
            source = np.where(y_a >= self._threshold, y_a, 0.0)
            reached = np.maximum(y_a, (w_c * source).max(axis=1))
            if np.array_equal(reached, y_a):
                break
            y_a = reached
            steps += 1
        links = (w_c * y_a == y_a[:, None]) & (y_a[:, None] > 0.0)
        links[start] = False
        return y_a, links, steps


def _sequence(first: int, successor: NDArray[np.int64]) -> tuple[int, ...]:
    """A neuron and its best continuation; empty for none (-1)."""
    neurons = []
    while first >= 0:
        neurons.append(first)
        first = int(successor[first])
    return tuple(neurons)
