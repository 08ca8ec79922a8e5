"""Planners on a map alone, as most tests use them."""

import numpy as np

from macor_hil.graded_map import GradedMap
from macor_hil.memory import Memory
from macor_hil.planners.planner import Now, Plan, Planner
from macor_hil.sensorimotor_map import SensorimotorMap


def square(transitions: SensorimotorMap, what: str) -> np.ndarray:
    """One of a map's quantities (z, w_r, w_c) for all pairs: row i present, column j past."""
    known = transitions.transitions()
    values = np.zeros((transitions.size, transitions.size))
    values[known.present, known.past] = getattr(known, what)
    return values


def plan(planner: Planner, transitions: SensorimotorMap, start: int) -> Plan:
    """What a planner makes of a map at a neuron."""
    nodes, commands = transitions.nodes, transitions.commands
    memory = Memory(transitions, GradedMap(nodes, commands))
    return planner.plan(memory, Now(start, np.eye(nodes)[start // commands]))
