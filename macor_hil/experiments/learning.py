"""The systems of table 1 and those beyond the paper, all learned from one recording."""

from dataclasses import dataclass, field
from typing import Final, NamedTuple

from macor_hil.clustering.clusterer import situations
from macor_hil.clustering.fuzzy_art import FuzzyArt
from macor_hil.drive import COMMANDS
from macor_hil.experiments.recording import Recording
from macor_hil.experiments.systems import Mind, learn_graded, learn_transitions
from macor_hil.graded_map import GradedMap
from macor_hil.memory import Memory
from macor_hil.planners.anticipative import Anticipative
from macor_hil.planners.expected import Expected
from macor_hil.planners.graded import Graded
from macor_hil.planners.planner import Planner
from macor_hil.planners.q_learning import QLearning, QMap
from macor_hil.planners.reactive import Reactive
from macor_hil.reinforcement import Reinforcement
from macor_hil.sensorimotor_map import Competence, SensorimotorMap

REACTIVE: Final = "reactive"
ANTICIPATIVE: Final = "anticipative"
Q: Final = "Q-learning"
WEAK: Final = "Q, gamma 0"
EXPECTED: Final = "expected value"
GRADED: Final = "graded situations"

SYSTEMS: Final = (REACTIVE, ANTICIPATIVE, Q, WEAK, EXPECTED, GRADED)


@dataclass(frozen=True)
class Learning:
    """How systems learn, with the values of section 3.2."""

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
    """What commands earn, not printed; from the table's means a step."""


class System(NamedTuple):
    """What has been learned, and how commands are chosen by it."""

    mind: Mind
    planner: Planner


def learn_all(learning: Learning, recording: Recording) -> dict[str, System]:
    """All systems by name; they share their situations.

    Situations and transitions are learned at the same time: the node of a frame is the one that
    it had when it was presented.
    """
    inputs = recording.inputs
    art = FuzzyArt(inputs.shape[1], learning.nodes, learning.vigilance, learning.alpha)
    nodes = situations(art, inputs, learn=True)
    size = learning.nodes, len(COMMANDS)
    plain = SensorimotorMap(*size, learning.competence)
    strong, weak = QMap(*size, learning.gamma), QMap(*size, 0.0)
    for transitions in (plain, strong, weak):
        learn_transitions(transitions, nodes, recording, learning.reinforcement)
    graded = GradedMap(*size)
    learn_graded(graded, recording.brain.prototypes, recording, learning.reinforcement)

    def system(transitions: SensorimotorMap, planner: Planner) -> System:
        return System(Mind(recording.brain, art, Memory(transitions, graded)), planner)

    return {
        REACTIVE: system(plain, Reactive()),
        ANTICIPATIVE: system(plain, Anticipative()),
        Q: system(strong, QLearning()),
        WEAK: system(weak, QLearning()),
        EXPECTED: system(plain, Expected()),
        GRADED: system(plain, Graded()),
    }
