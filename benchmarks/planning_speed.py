"""Planning time of the anticipative system against the number of neurons.

Maps of random transitions between neurons that are near each other, ten from each neuron, as
many as a trained map has.
"""

from collections.abc import Mapping
from contextlib import ExitStack
from time import process_time

import numpy as np
from figures import Figure

from macor_hil.mind.experience import Moment, Resonance
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.planners.anticipative import Anticipative

_COMMANDS = 3
_NEURONS = (150, 1_500, 15_000, 90_000)
_EACH = 10
"""Transitions that begin at a neuron."""
_FAR = 20
"""Situations that a transition leads on at most."""
_WORK = 150_000
"""Transitions to plan through in a round, in as many plans as that takes."""


class Planning:
    """Plans in maps of all sizes."""

    def __init__(self, _: ExitStack) -> None:
        self._rng = np.random.default_rng(0)
        self._maps = {size: self._map(size) for size in _NEURONS}

    def round(self) -> dict[str, float]:
        """Seconds of a plan for each size, from random neurons."""
        planner, found = Anticipative(), {}
        for size, memory in self._maps.items():
            starts = self._rng.integers(size, size=max(1, _WORK // len(memory)))
            begin = process_time()
            for neuron in starts.tolist():
                planner.plan(memory, in_neuron(neuron))
            found[str(size)] = (process_time() - begin) / len(starts)
        return found

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """Time of a plan, and how it grew from the smaller map's."""
        rows = []
        for smaller, size in zip((_NEURONS[0], *_NEURONS), _NEURONS, strict=False):
            plan, before = medians[str(size)], medians[str(smaller)]
            ways, fewer = (len(self._maps[n]) for n in (size, smaller))
            rows.append(
                Figure(
                    f"a plan, {size:,} neurons",
                    f"{1e3 * plan:.2f} ms",
                    f"{ways:,} transitions, {ways / fewer:.1f} times those of {smaller:,} neurons",
                    f"{plan / before:.1f}",
                )
            )
        return rows

    def _map(self, size: int) -> SensorimotorMap:
        rng = self._rng
        past = np.repeat(np.arange(size), _EACH)
        way = rng.integers(-_FAR, _FAR + 1, size=len(past)) * _COMMANDS
        present = (past + way + rng.integers(_COMMANDS, size=len(past))) % size
        past, present = np.unique(np.stack([past, present]), axis=1)
        transitions = SensorimotorMap(size // _COMMANDS, _COMMANDS)
        z = rng.integers(1, 20, size=len(past))
        transitions.load({"past": past, "present": present, "z": z, "w_r": rng.random(len(past))})
        transitions.transitions()
        return transitions


def in_neuron(neuron: int) -> Moment:
    """Return a moment of which only the neuron is known."""
    nothing = np.zeros(0)
    return Moment(nothing, nothing, Resonance(neuron // _COMMANDS, True, 1.0), neuron)
