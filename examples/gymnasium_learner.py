"""Another learner beside MACOR: fitted Q iteration, linear in the receptive fields.

It looks at the same receptive fields as MACOR, has the same three commands and the same experience
(13,400 random commands), and is scored like MACOR: 10 trials of 40 commands at
most, from starts near the arena's own.

    python examples/gymnasium_learner.py --seed 3
    macor-hil trials --port 'khepera://corridor?seed=3'
"""

from dataclasses import dataclass
from typing import Annotated, SupportsFloat

import gymnasium
import numpy as np
import typer

ENVIRONMENT = "macor_hil.environment:khepera/Commands-v0"
DISCOUNT = 0.9
SWEEPS = 60
RIDGE = 1.0

Environment = gymnasium.Env[np.ndarray, np.int64]


@dataclass
class Experience:
    """Transitions, one a row.

    Attributes:
        seen, then: features before and after, shape (transitions, features).
        command: index of what was driven.
        reward: what it earned.
        over: whether a collision ended the episode.
    """

    seen: np.ndarray
    command: np.ndarray
    reward: np.ndarray
    then: np.ndarray
    over: np.ndarray


class Policy:
    """Chooses the command of greatest value; values are linear in standardised features."""

    def __init__(self, experience: Experience) -> None:
        self._mean = experience.seen.mean(axis=0)
        self._scale = experience.seen.std(axis=0) + 1e-6
        before, after = self._inputs(experience.seen), self._inputs(experience.then)
        chosen = [experience.command == c for c in range(experience.command.max() + 1)]
        self._weights = np.zeros((len(chosen), before.shape[1]))
        for _ in range(SWEEPS):
            best = np.max(after @ self._weights.T, axis=1).clip(0.0, 1.0 / (1.0 - DISCOUNT))
            target = experience.reward + DISCOUNT * ~experience.over * best
            self._weights = np.array([_fit(before[c], target[c]) for c in chosen])

    def __call__(self, seen: np.ndarray) -> int:
        """Return the command for what is seen."""
        return int(np.argmax(self._weights @ self._inputs(seen)))

    def _inputs(self, seen: np.ndarray) -> np.ndarray:
        standard = (seen - self._mean) / self._scale
        return np.concatenate([standard, np.ones((*standard.shape[:-1], 1))], axis=-1)


def _fit(inputs: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Weights of ridge regression."""
    square = inputs.T @ inputs + RIDGE * np.eye(inputs.shape[1])
    return np.linalg.solve(square, inputs.T @ target)


def explore(env: Environment, seed: int, commands: int) -> Experience:
    """Drive random commands."""
    rows: list[tuple[np.ndarray, np.int64, SupportsFloat, np.ndarray, bool]] = []
    seen, _ = env.reset(seed=seed)
    env.action_space.seed(seed)
    for _ in range(commands):
        command = env.action_space.sample()
        then, reward, over, cut, _ = env.step(command)
        rows.append((seen, command, reward, then, over))
        seen = env.reset()[0] if over or cut else then
    return Experience(*map(np.array, zip(*rows, strict=True)))


def drive(env: Environment, policy: Policy, seed: int) -> tuple[int, float, bool]:
    """Drive an episode: its commands, their total reinforcement, whether a collision ended it."""
    seen, _ = env.reset(seed=seed)
    total, commands, collided, cut = 0.0, 0, False, False
    while not (collided or cut):
        seen, reward, collided, cut, _ = env.step(np.int64(policy(seen)))
        total, commands = total + float(reward), commands + 1
    return commands, total, collided


def main(
    seed: Annotated[int, typer.Option(help="Of the robot and of its experience.")] = 3,
    experience: Annotated[int, typer.Option(help="Commands to learn from.")] = 13_400,
    trials: Annotated[int, typer.Option(help="Trials to score the policy with.")] = 10,
) -> None:
    """Learn from random commands, then print how it does in trials."""
    port = f"khepera://corridor?seed={seed}"
    with gymnasium.make(ENVIRONMENT, port=port) as env:
        policy = Policy(explore(env, seed, experience))
    with gymnasium.make(ENVIRONMENT, port=port, start="arena") as env:
        scores = np.array([drive(env, policy, trial) for trial in range(trials)])
    commands, total, collided = scores.mean(axis=0)
    typer.echo(
        f"{trials} trials: {commands:.1f} commands and reinforcement {total:.1f} on average,"
        f" {collided:.0%} ended in a collision"
    )


if __name__ == "__main__":
    typer.run(main)
