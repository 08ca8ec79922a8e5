"""Outcomes of commands, in counts that are shared out among graded situations.

Beside the paper's map: the same 50 situations, but an experience counts for every situation as much
as the robot was in it (`clustering.membership`). How a situation was entered does not count.
"""

from collections.abc import Callable
from itertools import islice
from typing import Annotated, Protocol

import numpy as np
from pydantic import Field

from macor_hil.arrays import Array, State
from macor_hil.commands import MIRRORED
from macor_hil.mind.experience import Experience, Moment
from macor_hil.mind.memories.prototypes import WIDTH, Prototypes, placed
from macor_hil.mind.stored import MOST_COUNTED, MOST_EARNED, numbers

_ROUNDING = 1e-6
"""By which sums of shares may exceed what they are shares of."""

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
        counted: another number whenever any of these has changed.
    """

    def __init__(self, nodes: int, commands: int) -> None:
        self.nodes = nodes
        self.commands = commands
        self.led_to = np.zeros((nodes, commands, nodes))
        self.tried = np.zeros((nodes, commands))
        self.earned = np.zeros((nodes, commands))
        self.counted = 0

    def count(self, before: Array, command: int, after: Array | None, r: float) -> None:
        """Count one command.

        Args:
            before: memberships where it began, shape (n,).
            command: its index.
            after: memberships where it ended, shape (n,), or None after a collision.
            r: what it earned.
        """
        self.counted += 1
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

    def state(self) -> State:
        """Return all counts."""
        return {"led_to": self.led_to, "tried": self.tried, "earned": self.earned}

    def load(self, state: State) -> None:
        """Take over stored counts.

        Raises:
            ValueError, KeyError: they are missing, do not fit, or cannot have been counted.
        """
        n, m, most = self.nodes, self.commands, MOST_EARNED * MOST_COUNTED
        tried = numbers(state, "tried", (n, m), 0.0, MOST_COUNTED)
        led_to = numbers(state, "led_to", (n, m, n), 0.0, MOST_COUNTED)
        earned = numbers(state, "earned", (n, m), -most, most)
        room = tried * (1.0 + _ROUNDING) + _ROUNDING
        if (led_to.sum(axis=2) > room).any() or (np.abs(earned) > MOST_EARNED * room).any():
            raise ValueError("commands led to more, or earned more, than they were tried")
        self.led_to, self.tried, self.earned = led_to, tried, earned
        self.counted += 1


class GradedSituations(Protocol):
    """Tell how much an input belongs to each situation."""

    def memberships(self, x: Array) -> Array:
        """Return memberships, shape (n,), of an input of shape (M,)."""
        ...


_Known = tuple[Moment | None, GradedSituations, tuple[Array, Array]]
"""A moment, the situations of then, and its memberships with those of its mirror image."""


class GradedMemory:
    """Memory of graded situations: prototypes, and counts that are shared out among them.

    Every experience counts as its mirror image, too: a robot that is the same on both sides would
    have experienced that as well.

    Args:
        nodes: n, prototypes.
        commands: m.
        features: M.
        mirrored: features of the mirror image.
        width: of the memberships, see `prototypes.WIDTH`.
        both_sides: whether mirror images count.

    Attributes:
        situations: tell how much an input belongs to each.
        counts: what was counted.
    """

    def __init__(
        self,
        nodes: int,
        commands: int,
        features: int,
        mirrored: Callable[[Array], Array],
        width: Annotated[float, Field(ge=1e-3, le=1e3)] = WIDTH,
        both_sides: bool = True,
    ) -> None:
        self.situations: GradedSituations = Prototypes(np.zeros((nodes, features)), width)
        self.counts = GradedMap(nodes, commands)
        self._mirrored = mirrored
        self._width = width
        self._both_sides = both_sides
        nothing = np.zeros(0)
        self._last: _Known = None, self.situations, (nothing, nothing)

    def memberships(self, x: Array) -> Array:
        """Return how much features of shape (M,) belong to each situation, shape (n,)."""
        return self.situations.memberships(x)

    def tune(self, x: Array, rng: np.random.Generator) -> None:
        """Place the prototypes in what was seen and in its mirror image."""
        both = np.concatenate([x, self._mirrored(x)])
        self.situations = placed(both, self.counts.nodes, rng, self._width)

    def learn(self, experience: Experience) -> None:
        """Count an experience, and its mirror image."""
        command, r = experience.command, experience.reinforcement
        sides = zip(
            (command, MIRRORED[command]),
            self._belonging(experience.before),
            (None, None) if experience.collided else self._belonging(experience.after),
            strict=True,
        )
        for driven, before, after in islice(sides, 1 + self._both_sides):
            self.counts.count(before, driven, after, r)

    def state(self) -> State:
        """Return the prototypes' places, and all counts."""
        known = self.counts.state()
        if isinstance(self.situations, Prototypes):
            known["prototypes"] = self.situations.centres
        return known

    def load(self, state: State) -> None:
        """Take over a stored state.

        Raises:
            ValueError, KeyError: it does not fit this memory.
        """
        if isinstance(self.situations, Prototypes):
            # k-means in the single precision of OpenCV
            shape = self.situations.centres.shape
            centres = numbers(state, "prototypes", shape, -0.01, 1.01)
            self.situations = Prototypes(centres, self._width)
        self.counts.load(state)

    def _belonging(self, moment: Moment) -> tuple[Array, Array]:
        """Return the memberships of a moment and of its mirror image.

        Those of the moment seen last are kept: an experience begins where the one before ended.
        """
        if self._last[0] is not moment or self._last[1] is not self.situations:
            x = moment.features
            both = self.memberships(x), self.memberships(self._mirrored(x))
            self._last = moment, self.situations, both
        return self._last[2]
