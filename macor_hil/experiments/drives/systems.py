"""The systems of table 1 and those beyond the paper, all learned from one recording."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from macor_hil.commands import COMMANDS
from macor_hil.experiments.drives.course import System
from macor_hil.experiments.drives.training_drive import Recording
from macor_hil.mind.brain import Brain
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.eyes.eyes import FloorSeeing
from macor_hil.mind.memories.foresight import ForesightMemory
from macor_hil.mind.memories.graded import GradedMemory, GradedSituations
from macor_hil.mind.memories.memory import Memory
from macor_hil.mind.memories.places import PlacesMemory
from macor_hil.mind.memories.q_map import QMap
from macor_hil.mind.memories.transitions import Competence, SensorimotorMap
from macor_hil.mind.planners.anticipative import Anticipative
from macor_hil.mind.planners.expected import Expected
from macor_hil.mind.planners.foresight import Foresight
from macor_hil.mind.planners.graded import Graded
from macor_hil.mind.planners.planner import Planner
from macor_hil.mind.planners.q_learning import QLearning, WeakQLearning
from macor_hil.mind.planners.reactive import Reactive
from macor_hil.mind.reinforcement import Reinforcement

REACTIVE: Final = "reactive"
ANTICIPATIVE: Final = "anticipative"
Q: Final = "q-learning"
WEAK: Final = "weak-q-learning"
EXPECTED: Final = "expected"
GRADED: Final = "graded"
FORESIGHT: Final = "foresight"
PLACES: Final = "places"
GOAL: Final = "goal"

_PLANNERS: Final[Mapping[str, Callable[[], Planner]]] = {
    REACTIVE: Reactive,
    ANTICIPATIVE: Anticipative,
    Q: QLearning,
    WEAK: WeakQLearning,
    EXPECTED: Expected,
    GRADED: Graded,
}
SYSTEMS: Final = tuple(_PLANNERS)


@dataclass(frozen=True)
class Learning:
    """Settings of learning, with the values of section 3.2."""

    nodes: int = 50
    """n, Fuzzy ART nodes."""
    vigilance: float = 0.9
    """rho."""
    alpha: float = 0.001
    """Choice parameter of Fuzzy ART, not printed."""
    gamma: float = 0.9
    """Planning horizon of Q-learning."""
    competence: Competence = field(default_factory=Competence)
    """Equation 1."""
    reinforcement: Reinforcement = field(default_factory=Reinforcement)
    """The reinforcement of commands, not printed; from the table's means a step."""


def learn_all(learning: Learning, recording: Recording) -> dict[str, System]:
    """Learn all systems; they share one brain.

    Situations and transitions are learned at the same time: the node of a frame is the one that
    it had when it was presented.
    """
    size = learning.nodes, len(COMMANDS)
    memories: dict[str, Memory] = {
        "transitions": SensorimotorMap(*size, learning.competence),
        "q-learning": QMap(*size, learning.gamma),
        "weak-q-learning": QMap(*size, 0.0),
        "graded": graded_memory(learning, recording, situations_of(recording)),
    }
    eyes = recording.brain.eyes
    art = FuzzyArt(eyes.size, learning.nodes, learning.vigilance, learning.alpha)
    brain = Brain(eyes, art, memories, learning.reinforcement)
    brain.relive(recording.seen())
    return {name: System(brain, make()) for name, make in _PLANNERS.items()}


def learn_foresight(brain: Brain, recording: Recording) -> System:
    """Learn the foresight system from a recording of eyes that see where the floor ends.

    Args:
        brain: one that has learned its situations from the same recording.
        recording: of a drive.
    """
    assert isinstance(brain.eyes, FloorSeeing)
    memory = ForesightMemory(brain.eyes.directions)
    foreseeing = replace(brain, memories={FORESIGHT: memory})
    foreseeing.relive(recording.seen(), situations=False)
    return System(foreseeing, Foresight())


def learn_places(brain: Brain, recording: Recording) -> Brain:
    """Return a brain with a memory of the places of a recording, for goals to come.

    Args:
        brain: that of the recording, or another one with its eyes.
        recording: of a drive, with eyes that see where the floor ends.
    """
    assert isinstance(brain.eyes, FloorSeeing)
    knowing = replace(brain, memories={PLACES: PlacesMemory(brain.eyes.directions)})
    knowing.relive(recording.seen(), situations=False)
    return knowing


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
