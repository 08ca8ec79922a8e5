"""Planners and memories on their own, as most tests use them."""

import numpy as np

from macor_hil.mind.experience import Moment, Resonance
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.planners.planner import Plan, Planner


def moment(neuron: int = 0, features: np.ndarray | None = None) -> Moment:
    """A moment in a neuron, or at features."""
    x = np.zeros(0) if features is None else features
    return Moment(x, x, Resonance(neuron, True, 1.0), neuron)


def square(transitions: SensorimotorMap, what: str) -> np.ndarray:
    """One of a map's quantities (z, w_r, w_c) for all pairs: row i present, column j past."""
    known = transitions.transitions()
    values = np.zeros((transitions.size, transitions.size))
    values[known.present, known.past] = getattr(known, what)
    return values


def plan(planner: Planner, transitions: SensorimotorMap, start: int) -> Plan:
    """Return a planner's plan with a map at a neuron."""
    return planner.plan(transitions, moment(start))
