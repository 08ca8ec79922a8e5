"""TD-FALCON of artlib, another network of Fuzzy ART that learns what commands are worth.

Tan, Lu and Xiao (2008), "Integrating temporal difference methods and self-organizing neural
networks for reinforcement learning with delayed evaluative feedback". A node holds three boxes: of
what is seen, of a command, and of what that command is worth there. Nodes are added without a
cap; artlib learns values by SARSA, from whole sequences. artlib is optional (the extra `peers`)
and imported only where a network is made.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from macor_hil.drive import COMMANDS
from macor_hil.experiments.recording import PUT_DOWN, Recording
from macor_hil.memory import Memory
from macor_hil.planners.planner import Now, Plan, best_command
from macor_hil.reinforcement import Reinforcement

Array = NDArray[np.float64]

PEER: Final = "artlib"


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
    """How far a value moves to what was experienced, `td_alpha`."""
    alpha: float = 0.001
    """Choice parameter of Fuzzy ART; learning is fast (beta 1), as in the paper's."""

    def __str__(self) -> str:
        return (
            f"vigilance {self.state:g} and {self.worth:g}, lambda {self.discount:g},"
            f" rate {self.rate:g}"
        )


@dataclass(frozen=True, slots=True)
class Episode:
    """Commands in a row, from where the robot was put down.

    Attributes:
        seen: features before each command, shape (T, M).
        commands: their indices, shape (T,).
        earned: what each earned, shape (T,).
        collided: whether the last one ended in a collision.
    """

    seen: Array
    commands: NDArray[np.int64]
    earned: Array
    collided: bool


def episodes(recording: Recording, earns: Reinforcement) -> Iterator[Episode]:
    """The commands of a recording, from one put-down to the next."""
    inputs, r = recording.inputs, recording.reinforcement(earns)
    starts = np.flatnonzero(recording.commands == PUT_DOWN).tolist()
    for start, end in zip(starts, [*starts[1:], len(inputs)], strict=True):
        if end - start > 1:
            driven = slice(start + 1, end)
            yield Episode(
                inputs[start : end - 1],
                recording.commands[driven],
                r[driven],
                bool(recording.collided[end - 1]),
            )


class Network(Protocol):
    """What is used of artlib's TD_FALCON; channels are shaped (T, 2 M), (T, 2 m) and (T, 2)."""

    fusion_art: Any

    def prepare_data(self, states: Array, actions: Array, rewards: Array) -> tuple[Array, ...]:
        """Complement-code all three channels."""
        ...

    def partial_fit(self, states: Array, actions: Array, rewards: Array) -> object:
        """Learn a sequence; the value of its last command only where there is no other."""
        ...

    def get_actions_and_rewards(self, state: Array, action_space: Array) -> tuple[Array, Array]:
        """What each action is worth at a complement-coded state."""
        ...


class Falcon:
    """Takes the command that TD-FALCON finds worth most; nothing is simulated.

    Args:
        network: learns, and knows what commands are worth.
        discount: that of the network; what commands earn is scaled by 1 - discount, so that
            values stay between 0 and 1, where artlib would cut them off.
    """

    def __init__(self, network: Network, discount: float) -> None:
        self._network = network
        self._scale = 1.0 - discount

    @classmethod
    def of(cls, parameters: Parameters, features: int) -> Self:
        """An untaught one, for inputs of shape (features,).

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
        return len(self._network.fusion_art.W)

    def learn(self, episode: Episode) -> None:
        """Learn what the commands of an episode are worth."""
        channels = self._network.prepare_data(
            episode.seen,
            np.eye(len(COMMANDS))[episode.commands],
            self._scale * episode.earned[:, None],
        )
        if len(episode.commands) > 1:
            self._network.partial_fit(*channels)
        if episode.collided:
            # a sequence teaches all but its last command, whose successor is not known; after a
            # collision there is none, and alone the command is worth what it earned
            self._network.partial_fit(*(channel[-1:] for channel in channels))

    def plan(self, memory: Memory, now: Now) -> Plan:
        """Evaluate all commands at the present moment, whose memberships are the features."""
        del memory  # it has its own
        coded = np.concatenate([now.memberships, 1.0 - now.memberships])
        _, worth = self._network.get_actions_and_rewards(coded, np.eye(len(COMMANDS)))
        evaluations = tuple(worth.ravel().tolist())
        return Plan(evaluations, best_command(evaluations))


class FuzzySets:
    """What Fuzzy ART takes its inputs for: every feature a fuzzy set, its value the membership."""

    def memberships(self, x: Array) -> Array:
        """The features themselves, shape (M,)."""
        return x


def learn_falcon(parameters: Parameters, recording: Recording, earns: Reinforcement) -> Falcon:
    """Learn a recording, episode by episode, in its order.

    Raises:
        ImportError: artlib is not installed.
    """
    falcon = Falcon.of(parameters, recording.inputs.shape[1])
    for episode in episodes(recording, earns):
        falcon.learn(episode)
    return falcon
