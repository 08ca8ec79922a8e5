"""A learner of the Gymnasium ecosystem beside MACOR: CMA-ES searches a linear policy.

The policy looks at the same receptive fields as MACOR, has the same three commands and the same
experience (13,400 commands of training, from random places), and is scored like MACOR: 10 trials
of 40 commands at most, from starts near the arena's own.

    python examples/gymnasium_learner.py --seed 3
    macor-hil trials --port 'khepera://corridor?seed=3'
"""

from dataclasses import dataclass
from typing import Annotated

import cma
import gymnasium
import numpy as np
import typer

ENVIRONMENT = "macor_hil.environment:khepera/Commands-v0"


@dataclass
class Policy:
    """Chooses the command whose weighted sum of features is greatest.

    Attributes:
        weights: shape (commands, features + 1); the last column is a bias.
    """

    weights: np.ndarray

    @classmethod
    def of(cls, genome, env):
        """The policy of a flat vector of weights."""
        return cls(np.reshape(genome, (env.action_space.n, -1)))

    def __call__(self, features):
        """The command for what is seen."""
        return int(np.argmax(self.weights @ np.append(features - 0.5, 1.0)))


def drive(env, policy, **reset):
    """Drive an episode: its commands, their total reinforcement, whether a collision ended it."""
    seen, _ = env.reset(**reset)
    total, commands, collided, cut = 0.0, 0, False, False
    while not (collided or cut):
        seen, reward, collided, cut, _ = env.step(policy(seen))
        total, commands = total + reward, commands + 1
    return commands, total, collided


def train(port, seed, budget):
    """Search a policy with as many commands of experience as MACOR has."""
    env = gymnasium.make(ENVIRONMENT, port=port)
    size = env.action_space.n * (env.observation_space.shape[0] + 1)
    # a diagonal covariance: so few episodes say nothing of how the weights hang together
    options = {"seed": seed + 1, "CMA_diagonal": True, "popsize": 16, "verbose": -9}
    search = cma.CMAEvolutionStrategy(np.zeros(size), 1.0, options)
    env.reset(seed=seed)
    spent = 0
    while spent < budget:
        genomes = search.ask()
        results = [drive(env, Policy.of(genome, env)) for genome in genomes]
        search.tell(genomes, [-total for _, total, _ in results])
        spent += sum(commands for commands, _, _ in results)
    env.close()
    return Policy.of(search.result.xfavorite, env)


def main(
    seed: Annotated[int, typer.Option(help="Of the robot, the training and the trials.")] = 3,
    budget: Annotated[int, typer.Option(help="Commands to train with.")] = 13_400,
    trials: Annotated[int, typer.Option(help="Trials to score the policy with.")] = 10,
) -> None:
    """Train a policy, then print how it does in trials."""
    port = f"khepera://corridor?seed={seed}"
    policy = train(port, seed, budget)
    env = gymnasium.make(ENVIRONMENT, port=port, start="arena")
    scores = np.array([drive(env, policy, seed=k) for k in range(trials)])
    env.close()
    commands, total, collided = scores.mean(axis=0)
    typer.echo(
        f"{trials} trials: {commands:.1f} commands and reinforcement {total:.1f} on average,"
        f" {collided:.0%} ended in a collision"
    )


if __name__ == "__main__":
    typer.run(main)
