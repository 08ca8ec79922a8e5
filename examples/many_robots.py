"""REINFORCE on many robots at once, in NumPy: commands by the infrared sensors, to drive on.

    python examples/many_robots.py --robots 256 --updates 30

A linear softmax policy over the eight sensors, a constant and the last command; the return of a
step is what the rest of its episode earns (Williams 1992), with the mean over all as baseline. Each
update tells the mean reward of a step: 0 is a collision, 0.62 is to drive straight on.
"""

import argparse

import gymnasium
import numpy as np
import typer
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEPS = 20
GAMMA = 0.9
RATE = 8.0


def policy(weights: Array, inputs: Array) -> Array:
    """Return the chance of each command, shape (N, 3), at inputs of shape (N, M)."""
    scores = inputs @ weights
    shares = np.exp(scores - scores.max(axis=1, keepdims=True))
    chances: Array = shares / shares.sum(axis=1, keepdims=True)
    return chances


def inputs_of(seen: NDArray[np.float32], last: NDArray[np.int64]) -> Array:
    """Return inputs of shape (N, 12): nearness in [0, 1], a 1, and the last command."""
    ones = np.ones((len(seen), 1))
    return np.concatenate([seen / 1023.0, ones, np.eye(3)[last]], axis=1)


def train(robots: int, updates: int, seed: int) -> list[float]:
    """Train; return the mean reward of a step in each update."""
    envs = gymnasium.make_vec(
        "macor_hil.environment:khepera/Commands-v0", num_envs=robots, observation="proximity"
    )
    rng = np.random.default_rng(seed)
    weights = np.zeros((12, 3))
    seen, _ = envs.reset(seed=seed)
    last, over = np.full(robots, 2), np.zeros(robots, np.bool_)
    curve = []
    for _ in range(updates):
        slopes, rewards, ended, valid = [], [], [], []
        for _ in range(STEPS):
            inputs = inputs_of(seen, last)
            chances = policy(weights, inputs)
            actions = (chances.cumsum(axis=1) > rng.random((robots, 1))).argmax(axis=1)
            slopes.append(inputs[:, :, None] * (np.eye(3)[actions] - chances)[:, None, :])
            valid.append(~over)  # the action of a robot that begins anew is ignored
            seen, reward, terminated, truncated, _ = envs.step(actions)
            over, last = terminated | truncated, actions
            rewards.append(reward)
            ended.append(over)
        returns, after = np.zeros((STEPS, robots)), np.zeros(robots)
        for step in range(STEPS - 1, -1, -1):
            after = rewards[step] + GAMMA * np.where(ended[step], 0.0, after)
            returns[step] = after
        counted = np.array(valid)
        gain = np.where(counted, returns - returns[counted].mean(), 0.0)
        weights += RATE * np.einsum("tn,tnmk->mk", gain, np.array(slopes)) / counted.sum()
        curve.append(float(np.array(rewards)[counted].mean()))
    envs.close()
    return curve


def main() -> None:
    """Train and print the curve."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--robots", type=int, default=256)
    parser.add_argument("--updates", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    for number, reward in enumerate(train(given.robots, given.updates, given.seed), 1):
        typer.echo(f"update {number}: {reward:.3f}")


if __name__ == "__main__":
    main()
