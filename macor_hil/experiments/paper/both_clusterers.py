"""Reactive systems on Fuzzy ART and on a Neural Gas, each trained in sequence (section 3.1).

First the situations are learned from inputs, then, with the situations fixed, the transitions of a
whole drive.
"""

from typing import Final

from macor_hil.arrays import Array
from macor_hil.commands import COMMANDS
from macor_hil.experiments.drives.course import System
from macor_hil.experiments.drives.training_drive import Recording
from macor_hil.mind.brain import Brain
from macor_hil.mind.clusterers.clusterer import Clusterer
from macor_hil.mind.clusterers.clusterer_error import situations
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.clusterers.neural_gas import Annealing, Breadth, NeuralGas, search, trained
from macor_hil.mind.memories.transitions import Competence, SensorimotorMap
from macor_hil.mind.planners.planner import Planner
from macor_hil.mind.planners.reactive import Reactive
from macor_hil.mind.reinforcement import Reinforcement

ART: Final = "Fuzzy ART"
GAS: Final = "Neural Gas"


def trained_art(inputs: Array, nodes: int, vigilance: float, alpha: float) -> FuzzyArt:
    """Present inputs of shape (T, M) once to a new Fuzzy ART."""
    art = FuzzyArt(inputs.shape[1], nodes, vigilance, alpha)
    situations(art, inputs, learn=True)
    return art


def searched_annealing(
    inputs: Array, nodes: int, breadth: Breadth, presentations: int, every: int, seed: int
) -> Annealing:
    """Search for the parameters of a Neural Gas that end with the smallest error.

    Args:
        inputs: shape (T, M).
        nodes: n.
        breadth: the combinations that are tried.
        presentations: how often all inputs are presented.
        every: every so many-th input is used in the search.
        seed: of the first weights.

    Returns:
        The best combination, annealed over all presentations of all inputs.
    """
    data = inputs[::every]
    tried = breadth.annealings(presentations * len(data))
    best = search(data, nodes, tried, presentations, seed)
    return Annealing(best.rate, best.radius, presentations * len(inputs))


def trained_gas(
    inputs: Array, nodes: int, breadth: Breadth, presentations: int, every: int, seed: int
) -> NeuralGas:
    """Train a Neural Gas with the parameters that are searched for; see `searched_annealing`."""
    annealing = searched_annealing(inputs, nodes, breadth, presentations, every, seed)
    return trained(inputs, nodes, annealing, presentations, seed)


def reactive_system(
    recording: Recording,
    clusterer: Clusterer,
    nodes: int,
    competence: Competence,
    reinforcement: Reinforcement,
    planner: Planner | None = None,
) -> System:
    """Learn the transitions of a whole drive between fixed situations.

    Args:
        recording: the drive.
        clusterer: the situations, which are not changed.
        nodes: n, the most situations.
        competence: parameters of equation 1.
        reinforcement: what commands earn.
        planner: chooses commands; None: reactively.
    """
    memory = SensorimotorMap(nodes, len(COMMANDS), competence)
    brain = Brain(recording.brain.eyes, clusterer, {"transitions": memory}, reinforcement)
    brain.relive(recording.seen(), situations=False)
    return System(brain, Reactive() if planner is None else planner)
