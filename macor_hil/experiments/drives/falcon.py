"""TD-FALCON of artlib, another network of Fuzzy ART that learns what commands are worth.

Tan, Lu and Xiao (2008), "Integrating temporal difference methods and self-organizing neural
networks for reinforcement learning with delayed evaluative feedback". A node holds three boxes: of
what is seen, of a command, and of what that command is worth there. Nodes are added without a
cap; artlib learns values by SARSA, from whole sequences. artlib is optional (the extra `peers`)
and imported only where a network is made.
"""

from dataclasses import dataclass
from typing import Any, Final, Protocol, Self

import numpy as np

from macor_hil.arrays import Array, State
from macor_hil.commands import COMMANDS
from macor_hil.mind.experience import Experience, Moment
from macor_hil.mind.planners.planner import Plan, best_command

PEER: Final = "artlib"

MEMORY: Final = "td-falcon"
"""Name of its memory."""


@dataclass(frozen=True)
class Parameters:
    """Parameters of TD-FALCON."""

    state: float = 0.6
    """Vigilance of what is seen."""
    worth: float = 0.8
    """Vigilance of what a command is worth; that of commands is 1: each is itself only."""
    discount: float = 0.9
    """Of what comes a command later, `td_lambda` in artlib; 0: the next command alone counts."""
    rate: float = 1.0
    """The share by which a value moves to what was experienced, `td_alpha`."""
    alpha: float = 0.001
    """Choice parameter of Fuzzy ART; learning is fast (beta 1), as in the paper's."""

    def __str__(self) -> str:
        return (
            f"vigilance {self.state:g} and {self.worth:g}, lambda {self.discount:g},"
            f" rate {self.rate:g}"
        )


class Network(Protocol):
    """The used part of artlib's TD_FALCON; channels are shaped (T, 2 M), (T, 2 m) and (T, 2)."""

    fusion_art: Any

    def prepare_data(self, states: Array, actions: Array, rewards: Array) -> tuple[Array, ...]:
        """Complement-code all three channels."""
        ...

    def partial_fit(self, states: Array, actions: Array, rewards: Array) -> object:
        """Learn a sequence; the value of its last command only where there is no other."""
        ...

    def get_actions_and_rewards(self, state: Array, action_space: Array) -> tuple[Array, Array]:
        """Return the value of each action at a complement-coded state."""
        ...


class Falcon:
    """Memory of what TD-FALCON finds commands worth.

    Args:
        network: learns, and knows what commands are worth.
        discount: that of the network; what commands earn is scaled by 1 - discount, so that
            values stay between 0 and 1, where artlib would cut them off.
    """

    def __init__(self, network: Network, discount: float) -> None:
        self._network = network
        self._steps: list[Experience] = []
        self._scale = 1.0 - discount

    @classmethod
    def of(cls, parameters: Parameters, features: int) -> Self:
        """Return an untaught one, for inputs of shape (features,).

        Raises:
            ImportError: artlib is not installed.
        """
        from artlib import TD_FALCON, FuzzyART

        widths = features, len(COMMANDS), 1
        vigilances = parameters.state, 1.0, parameters.worth
        channels = [FuzzyART(rho=rho, alpha=parameters.alpha, beta=1.0) for rho in vigilances]
        for channel, width in zip(channels, widths, strict=True):
            channel.set_data_bounds(np.zeros(width), np.ones(width))
        network = TD_FALCON(
            *channels,
            channel_dims=[2 * width for width in widths],
            td_alpha=parameters.rate,
            td_lambda=parameters.discount,
        )
        return cls(network, parameters.discount)

    @property
    def nodes(self) -> int:
        """Nodes that have been added."""
        self._end()
        return len(self._network.fusion_art.W)

    def tune(self, x: Array, rng: np.random.Generator) -> None:
        """Prepare for nothing: nodes are added as inputs come."""

    def learn(self, experience: Experience) -> None:
        """Collect an experience; an episode is learned when it has ended."""
        if self._steps and self._steps[-1].after is not experience.before:
            self._end()
        self._steps.append(experience)
        if experience.collided:
            self._end()

    def evaluations(self, x: Array) -> Array:
        """Return what each command is worth at features of shape (M,), shape (m,)."""
        self._end()
        coded = np.concatenate([x, 1.0 - x])
        _, worth = self._network.get_actions_and_rewards(coded, np.eye(len(COMMANDS)))
        return np.asarray(worth, float).ravel()

    def state(self) -> State:
        """Return nothing: what artlib learned is not kept in maps."""
        return {}

    def load(self, state: State) -> None:
        """Take over nothing."""

    def _end(self) -> None:
        """Learn what the commands of the episode that was collected are worth."""
        steps, self._steps = self._steps, []
        if not steps:
            return
        channels = self._network.prepare_data(
            np.array([step.before.features for step in steps]),
            np.eye(len(COMMANDS))[[step.command for step in steps]],
            self._scale * np.array([[step.reinforcement] for step in steps]),
        )
        if len(steps) > 1:
            self._network.partial_fit(*channels)
        if steps[-1].collided:
            # a sequence teaches all but its last command, whose successor is not known; after a
            # collision there is none, and alone the command is worth what it earned
            self._network.partial_fit(*(channel[-1:] for channel in channels))


class FalconPlanner:
    """Takes the command that TD-FALCON finds worth most; nothing is simulated."""

    memory = MEMORY

    def plan(self, memory: Falcon, now: Moment) -> Plan:
        """Evaluate all commands at the present features."""
        evaluations = tuple(memory.evaluations(now.features).tolist())
        return Plan(evaluations, best_command(evaluations))
