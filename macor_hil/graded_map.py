"""What commands lead to, in counts that are shared out among graded situations.

Beside the paper's map: the same 50 situations, but an experience counts for every situation as much
as the robot was in it (`clustering.membership`). How a situation was entered does not count.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DOUBT = 1.0
"""Experiences of a command that a situation counts on top of its own, all ending in nothing: what
was hardly ever tried is worth little, which is competence in the terms of equation 1."""


class GradedMap:
    """Shared-out counts of commands, their outcomes and their reinforcement.

    Attributes:
        nodes: n, situations.
        commands: m, commands.
        led_to: how often command a in situation k led to situation k', shape (n, m, n), indexed
            [k, a, k']; nothing follows a collision.
        tried: how often command a was driven in situation k, shape (n, m).
        earned: sum of the reinforcement that it earned, shape (n, m).
    """

    def __init__(self, nodes: int, commands: int) -> None:
        self.nodes = nodes
        self.commands = commands
        self.led_to = np.zeros((nodes, commands, nodes))
        self.tried = np.zeros((nodes, commands))
        self.earned = np.zeros((nodes, commands))

    def learn(self, before: Array, command: int, after: Array | None, r: float) -> None:
        """Count one command.

        Args:
            before: memberships where it began, shape (n,).
            command: its index.
            after: memberships where it ended, shape (n,), or None after a collision.
            r: what it earned.
        """
        self.tried[:, command] += before
        self.earned[:, command] += before * r
        if after is not None:
            self.led_to[:, command] += np.outer(before, after)

    def outcomes(self, doubt: float = DOUBT) -> tuple[Array, Array]:
        """Chance of each outcome, shape (n, m, n), and expected reinforcement, shape (n, m).

        The chances of a command sum to less than 1: what is missing are collisions, and doubt.
        """
        weight = self.tried + doubt
        return self.led_to / weight[:, :, None], self.earned / weight

    def load(self, led_to: Array, tried: Array, earned: Array) -> None:
        """Take over stored counts.

        Raises:
            ValueError: their shapes do not fit.
        """
        for name, mine, theirs in (
            ("led_to", self.led_to, led_to),
            ("tried", self.tried, tried),
            ("earned", self.earned, earned),
        ):
            if mine.shape != theirs.shape:
                raise ValueError(f"{name} of shape {theirs.shape} does not fit {mine.shape}")
        self.led_to, self.tried, self.earned = led_to, tried, earned
