"""Value iteration: what commands are worth, looking one command further ahead at each step.

    Q(k, a) = r(k, a) + gamma * sum over k' of p(k' | k, a) * max over a' of Q(k', a')

(Bellman 1957), for k' the max being over the commands that were tried there.
"""

import numpy as np

from macor_hil.arrays import Array, Mask


def iterate(
    chance: Array,
    reward: Array,
    tried: Mask,
    *,
    gamma: float,
    max_steps: int,
    settled: float,
) -> tuple[Array, int]:
    """Evaluate all commands in all situations.

    Args:
        chance: p(k' | k, a), shape (n, m, n), indexed [k, a, k'].
        reward: r(k, a), shape (n, m).
        tried: the commands that can be chosen, shape (n, m); a situation without any is worth 0.
        gamma: discount of what comes a command later.
        max_steps: steps at most.
        settled: change of the evaluations below which they count as settled.

    Returns:
        Q, shape (n, m), and the number of steps.
    """
    n, m = reward.shape
    # commands first: then a step is one product of a matrix, and one maximum of whole rows
    ahead = np.ascontiguousarray(gamma * chance.transpose(1, 0, 2)).reshape(m * n, n)
    at_once, choices = np.ascontiguousarray(reward.T).reshape(m * n), tried.T
    barren = ~tried.any(axis=1)
    q = np.zeros(m * n)
    steps = 0
    while steps < max_steps:
        value = np.maximum.reduce(q.reshape(m, n), where=choices, initial=-np.inf)
        value[barren] = 0.0
        before, q = q, at_once + ahead @ value
        steps += 1
        if np.abs(q - before).max() < settled:
            break
    return q.reshape(m, n).T, steps
