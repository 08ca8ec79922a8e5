"""Fitted Q iteration over all experiences: values of commands, linear in the features.

With s the features of a moment, standardised and followed by a 1, and w_a the weights of command a,

    Q(s, a) = w_a . s,
    w_a <- argmin over w of  sum (w . s - r - gamma * max over b of Q(s', b))^2 + ridge * |w|^2,

where the sum runs over all experiences (s, a, r, s') of the command, from w = 0, sweep after sweep
(Ernst, Geurts and Wehenkel 2005, with a linear fit in place of trees). Nothing follows a collision.
There are no situations: what carries over from one view to another is that values are linear.
"""

from collections import deque
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from macor_hil.arrays import Array, State
from macor_hil.mind.experience import Experience
from macor_hil.mind.stored import MOST_EARNED, numbers, whole

_FLAT: Final = 1e-6
"""Added to the deviation of a feature, which may be the same in all experiences."""


class _Step(NamedTuple):
    """An experience, its features in single precision."""

    before: NDArray[np.float32]
    command: int
    earned: float
    after: NDArray[np.float32]
    collided: bool


class FittedQMemory:
    """Memory of experiences, and of the values that are fitted to them when they are asked for.

    Args:
        commands: m.
        features: M.
        gamma: discount of what comes a command later.
        sweeps: fits, each to the values of the one before.
        ridge: penalty of large weights.
        experiences: how many of the last ones are kept and learned from.
    """

    def __init__(
        self,
        commands: int,
        features: int,
        gamma: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.9,
        sweeps: Annotated[int, Field(ge=1, le=1_000)] = 60,
        ridge: Annotated[float, Field(gt=0.0, le=1e6)] = 1.0,
        experiences: Annotated[int, Field(ge=1, le=100_000)] = 20_000,
    ) -> None:
        self._commands = commands
        self._features = features
        self._gamma = gamma
        self._sweeps = sweeps
        self._ridge = ridge
        self._steps: deque[_Step] = deque(maxlen=experiences)
        self._values: _Values | None = None

    def tune(self, x: Array, rng: np.random.Generator) -> None:
        """Prepare for nothing: features are standardised by the experiences."""

    def learn(self, experience: Experience) -> None:
        """Keep an experience; values are fitted anew when they are asked for next."""
        before, after = (
            moment.features.astype(np.float32) for moment in (experience.before, experience.after)
        )
        r = experience.reinforcement
        self._steps.append(_Step(before, experience.command, r, after, experience.collided))
        self._values = None

    def evaluations(self, x: Array) -> tuple[float | None, ...]:
        """Return what each command is worth at features of shape (M,); None: never driven."""
        if not self._steps:
            return (None,) * self._commands
        if self._values is None:
            self._values = self._fitted()
        worth = self._values.worth(x).tolist()
        known = self._values.driven.tolist()
        return tuple(value if at else None for value, at in zip(worth, known, strict=True))

    def state(self) -> State:
        """Return the kept experiences; their values follow from them."""
        shape = len(self._steps), self._features
        return {
            "before": np.array([s.before for s in self._steps], np.float32).reshape(shape),
            "commands": np.array([s.command for s in self._steps], np.int8),
            "earned": np.array([s.earned for s in self._steps], np.float64),
            "after": np.array([s.after for s in self._steps], np.float32).reshape(shape),
            "collided": np.array([s.collided for s in self._steps], np.int8),
        }

    def load(self, state: State) -> None:
        """Take over stored experiences.

        Raises:
            ValueError, KeyError: something is missing, does not fit, or cannot have been seen.
        """
        shape = None, self._features
        before, after = (numbers(state, name, shape, 0.0, 1.0) for name in ("before", "after"))
        commands = whole(state, "commands", 0, self._commands - 1)
        earned = numbers(state, "earned", (None,), -MOST_EARNED, MOST_EARNED)
        collided = whole(state, "collided", 0, 1)
        if not len(before) == len(commands) == len(earned) == len(after) == len(collided):
            raise ValueError("it has not as many features as commands")
        rows = zip(
            before, commands.tolist(), earned.tolist(), after, collided.tolist(), strict=True
        )
        self._steps.clear()
        self._steps.extend(
            _Step(x.astype(np.float32), a, r, y.astype(np.float32), bool(hit))
            for x, a, r, y, hit in rows
        )
        self._values = None

    def _fitted(self) -> "_Values":
        seen = np.array([s.before for s in self._steps], float)
        command = np.array([s.command for s in self._steps])
        r = np.array([s.earned for s in self._steps])
        goes_on = ~np.array([s.collided for s in self._steps])
        values = _Values(seen.mean(axis=0), seen.std(axis=0) + _FLAT, self._commands)
        before = values.inputs(seen)
        after = values.inputs(np.array([s.after for s in self._steps], float))
        # what can be earned at all: a linear fit may promise more
        low, high = min(0.0, r.min()) / (1.0 - self._gamma), max(0.0, r.max()) / (1.0 - self._gamma)
        fits = [_Fit(before, command == a, self._ridge) for a in range(self._commands)]
        for _ in range(self._sweeps):
            best = (after @ values.weights.T).max(axis=1).clip(low, high)
            target = r + self._gamma * goes_on * best
            values.weights = np.array([fit(target) for fit in fits])
        values.driven = np.bincount(command, minlength=self._commands) > 0
        return values


class _Fit:
    """A ridge regression of rows that are chosen once, to one target after another."""

    def __init__(self, inputs: Array, chosen: NDArray[np.bool_], ridge: float) -> None:
        self._chosen = chosen
        rows = inputs[chosen]
        square = rows.T @ rows + ridge * np.eye(inputs.shape[1])
        self._solution = np.linalg.solve(square, rows.T)

    def __call__(self, target: Array) -> Array:
        """Return the weights, shape (M + 1,)."""
        weights: Array = self._solution @ target[self._chosen]
        return weights


class _Values:
    """Values that are linear in standardised features."""

    def __init__(self, mean: Array, scale: Array, commands: int) -> None:
        self._mean = mean
        self._scale = scale
        self.weights: Array = np.zeros((commands, len(mean) + 1))
        self.driven = np.zeros(commands, np.bool_)

    def inputs(self, x: Array) -> Array:
        """Return standardised features followed by a 1, shape (..., M + 1)."""
        standard = (x - self._mean) / self._scale
        return np.concatenate([standard, np.ones((*x.shape[:-1], 1))], axis=-1)

    def worth(self, x: Array) -> Array:
        """Return the value of each command at features of shape (M,), shape (m,)."""
        values: Array = self.weights @ self.inputs(x)
        return values
