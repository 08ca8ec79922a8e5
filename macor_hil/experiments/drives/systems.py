"""The systems of table 1 and those beyond the paper, all learned from one recording."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Final

import numpy as np
from pydantic import Field

from macor_hil.commands import COMMANDS
from macor_hil.experiments.drives.course import System
from macor_hil.experiments.drives.training_drive import Recording
from macor_hil.mind.brain import Brain
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.eyes.eyes import Eyes, FloorSeeing
from macor_hil.mind.memories.fitted_q import FittedQMemory
from macor_hil.mind.memories.foresight import ForesightMemory
from macor_hil.mind.memories.graded import GradedMemory, GradedSituations
from macor_hil.mind.memories.memory import Memory
from macor_hil.mind.memories.prototypes import placed
from macor_hil.mind.memories.q_map import QMap
from macor_hil.mind.memories.successor import SuccessorMap
from macor_hil.mind.memories.transitions import Competence, SensorimotorMap
from macor_hil.mind.planners.anticipative import Anticipative
from macor_hil.mind.planners.expected import Expected
from macor_hil.mind.planners.fitted_q import FittedQ
from macor_hil.mind.planners.foresight import Foresight
from macor_hil.mind.planners.graded import Graded
from macor_hil.mind.planners.planner import Planner
from macor_hil.mind.planners.q_learning import QLearning, WeakQLearning
from macor_hil.mind.planners.reactive import Reactive
from macor_hil.mind.planners.successor import Successor
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.mind.settings import MOST_NODES

REACTIVE: Final = "reactive"
ANTICIPATIVE: Final = "anticipative"
Q: Final = "q-learning"
WEAK: Final = "weak-q-learning"
EXPECTED: Final = "expected"
GRADED: Final = "graded"
FITTED_Q: Final = "fitted-q"
SUCCESSOR: Final = "successor"
FORESIGHT: Final = "foresight"

_PLANNERS: Final[Mapping[str, Callable[[], Planner]]] = {
    REACTIVE: Reactive,
    ANTICIPATIVE: Anticipative,
    Q: QLearning,
    WEAK: WeakQLearning,
    EXPECTED: Expected,
    GRADED: Graded,
    FITTED_Q: FittedQ,
    SUCCESSOR: Successor,
    FORESIGHT: Foresight,
}
SYSTEMS: Final = (REACTIVE, ANTICIPATIVE, Q, WEAK, EXPECTED, GRADED)
"""Those of table 1."""

_PLACING: Final = 400
"""Frames that prototypes are placed in where their number is not that of the recording's."""


@dataclass(frozen=True)
class Learning:
    """Settings of learning, with the values of section 3.2."""

    nodes: Annotated[int, Field(ge=1, le=MOST_NODES)] = 50
    """n, Fuzzy ART nodes."""
    vigilance: Annotated[float, Field(ge=0.0, le=1.0)] = 0.9
    """rho."""
    alpha: Annotated[float, Field(gt=0.0)] = 0.001
    """Choice parameter of Fuzzy ART, not printed."""
    gamma: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.9
    """Planning horizon of Q-learning, fitted Q and the successor representation."""
    competence: Competence = field(default_factory=Competence)
    """Equation 1."""
    reinforcement: Reinforcement = field(default_factory=Reinforcement)
    """The reinforcement of commands, not printed; from the table's means a step."""


def learn_all(
    learning: Learning, recording: Recording, names: Sequence[str] = SYSTEMS
) -> dict[str, System]:
    """Learn systems; they share one brain.

    Situations and transitions are learned at the same time: the node of a frame is the one that
    it had when it was presented.

    Args:
        learning: settings of all of them.
        recording: the drive that they learn from.
        names: of the systems.
    """
    planners = {name: _PLANNERS[name]() for name in names}
    makers = _memories(learning, recording)
    read = {planner.memory for planner in planners.values()}
    memories = {name: make() for name, make in makers.items() if name in read}
    brain = _learned(learning, recording, memories)
    return {name: System(brain, planner) for name, planner in planners.items()}


def learn_situations(
    learning: Learning, recording: Recording, rng: np.random.Generator
) -> dict[str, System]:
    """Learn the systems of expected values alone, on as many situations as are asked for.

    The prototypes of graded situations are placed anew, in the first frames of the recording: as
    many as the drive that tunes the eyes has commands.

    Args:
        learning: settings, with the number of situations.
        recording: the drive that they learn from.
        rng: of the prototypes' first guesses.
    """
    eyes = recording.brain.eyes
    x = eyes.tuned(recording.raw[:_PLACING])
    prototypes = placed(np.concatenate([x, eyes.mirrored(x)]), learning.nodes, rng)
    memories: dict[str, Memory] = {
        "transitions": SensorimotorMap(learning.nodes, len(COMMANDS), learning.competence),
        "graded": graded_memory(learning, recording, prototypes),
    }
    brain = _learned(learning, recording, memories)
    return {name: System(brain, _PLANNERS[name]()) for name in (EXPECTED, GRADED)}


def learn_foresight(learning: Learning, recording: Recording) -> System:
    """Learn the foresight system alone, which needs no situations."""
    memory = ForesightMemory(_directions(recording.brain.eyes))
    earns = learning.reinforcement
    brain = replace(recording.brain, memories={FORESIGHT: memory}, reinforcement=earns)
    brain.relive(recording.seen(), situations=False)
    return System(brain, Foresight())


def _learned(learning: Learning, recording: Recording, memories: Mapping[str, Memory]) -> Brain:
    """Return a brain that has learned situations and memories from a recording."""
    eyes = recording.brain.eyes
    art = FuzzyArt(eyes.size, learning.nodes, learning.vigilance, learning.alpha)
    brain = Brain(eyes, art, memories, learning.reinforcement)
    brain.relive(recording.seen())
    return brain


def _memories(learning: Learning, recording: Recording) -> dict[str, Callable[[], Memory]]:
    """Return what makes each memory, empty, by its name."""
    size, eyes = (learning.nodes, len(COMMANDS)), recording.brain.eyes
    return {
        "transitions": lambda: SensorimotorMap(*size, learning.competence),
        "q-learning": lambda: QMap(*size, learning.gamma),
        "weak-q-learning": lambda: QMap(*size, 0.0),
        "graded": lambda: graded_memory(learning, recording, situations_of(recording)),
        "fitted-q": lambda: FittedQMemory(len(COMMANDS), eyes.size, learning.gamma),
        "successor": lambda: SuccessorMap(*size, learning.gamma),
        "foresight": lambda: ForesightMemory(_directions(eyes)),
    }


def _directions(eyes: Eyes) -> int:
    return eyes.directions if isinstance(eyes, FloorSeeing) else 0


def situations_of(recording: Recording) -> GradedSituations:
    """Return the prototypes that were placed in the recording's tuning drive."""
    memory = recording.brain.memories["graded"]
    assert isinstance(memory, GradedMemory)
    return memory.situations


def graded_memory(
    learning: Learning,
    recording: Recording,
    situations: GradedSituations,
    *,
    both_sides: bool = True,
) -> GradedMemory:
    """Make an empty memory of given graded situations, for the eyes of a recording."""
    eyes = recording.brain.eyes
    memory = GradedMemory(
        learning.nodes, len(COMMANDS), eyes.size, eyes.mirrored, both_sides=both_sides
    )
    memory.situations = situations
    return memory
