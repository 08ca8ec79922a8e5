"""Collision avoidance in testable terms: the claims of figures 3 and 4 (section 3.1).

A system is shown to avoid collisions if it collides in fewer than half of its trials, with the
whole 95 % interval over training seeds below half, and if its trials are longer than those of a
robot that drives straight on from the same starts. Figure 3 claims that both fully trained systems
avoid collisions, Fuzzy ART with early turns. Figure 4 claims that after 1,000 steps of sensory
training only Fuzzy ART does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from macor_hil.experiments.report.statistics import Estimate, Order, estimate, mean, order
from macor_hil.runs.trials import Trial

HALF: Final = 0.5
"""Share of collided trials below which a system is said to avoid collisions."""


@dataclass(frozen=True, slots=True)
class Behaviour:
    """Behaviour of a system, one value a training seed.

    Attributes:
        lengths: mean number of commands in a trial.
        collided: share of the trials that ended in a collision.
        before_turn: mean number of commands before the first turn; all where there is none.
        turns: share of the commands that were turns and did not collide.
    """

    lengths: tuple[float, ...]
    collided: tuple[float, ...]
    before_turn: tuple[float, ...]
    turns: tuple[float, ...]

    @property
    def share(self) -> Estimate:
        """Share of the trials that collided, mean over seeds."""
        return estimate(self.collided, mean)


def behaviour(seeds: Sequence[Sequence[Trial]], turn: float) -> Behaviour:
    """Return the behaviour in trials, a list for each seed.

    Args:
        seeds: the trials.
        turn: what a turn earns, by which it is told from straight on.
    """

    def means(values: Sequence[Sequence[float]]) -> tuple[float, ...]:
        return tuple(float(np.mean(each)) for each in values)

    return Behaviour(
        means([[one.length for one in trials] for trials in seeds]),
        means([[one.collided for one in trials] for trials in seeds]),
        means([[_before_turn(one, turn) for one in trials] for trials in seeds]),
        means([[r == turn for one in trials for r in one.reinforcement] for trials in seeds]),
    )


def _before_turn(trial: Trial, turn: float) -> int:
    earned = list(trial.reinforcement)
    return earned.index(turn) if turn in earned else len(earned)


def avoids(system: Behaviour, straight: Behaviour | None = None) -> bool:
    """Return True if a system is shown to avoid collisions.

    Args:
        system: its trials.
        straight: trials of a robot that drives straight on; None: they were not driven.
    """
    if system.share.high >= HALF:
        return False
    return straight is None or order(system.lengths, straight.lengths).holds


@dataclass(frozen=True, slots=True)
class Claim:
    """A claim of the paper, tested.

    Attributes:
        holds: whether it does.
        said: the outcome in a few words.
    """

    holds: bool
    said: str


def figure3_claim(art: Behaviour, gas: Behaviour, straight: Behaviour | None = None) -> Claim:
    """Test that both fully trained systems avoid collisions, Fuzzy ART with earlier turns."""
    if (several := _who_avoids(art, gas, straight)) != "both avoid":
        return Claim(False, several)
    if not order(gas.before_turn, art.before_turn).holds:
        return Claim(False, "both avoid, no earlier turns of Fuzzy ART")
    return Claim(True, "both avoid, Fuzzy ART with earlier turns")


def figure4_claim(art: Behaviour, gas: Behaviour, straight: Behaviour | None = None) -> Claim:
    """Test that after 1,000 steps only Fuzzy ART avoids collisions, and so drives longer."""
    several = _who_avoids(art, gas, straight)
    if several != "only Fuzzy ART avoids":
        return Claim(False, several)
    if not order(art.lengths, gas.lengths).holds:
        return Claim(False, f"{several}, but is not shown to drive longer")
    return Claim(True, several)


def _who_avoids(art: Behaviour, gas: Behaviour, straight: Behaviour | None) -> str:
    match avoids(art, straight), avoids(gas, straight):
        case True, True:
            return "both avoid"
        case True, False:
            return "only Fuzzy ART avoids"
        case False, True:
            return "only the Neural Gas avoids"
    return "neither avoids"


def longer(art: Behaviour, gas: Behaviour) -> Order:
    """Test that trials of Fuzzy ART are longer, paired by seed."""
    return order(art.lengths, gas.lengths)
