"""Ratios of `make bench` that asv keeps for each commit: docs/benchmarks.md shows how to read them.

Each is a time over that of a floor or of a peer, measured in turn with it, so that commits can be
compared though the machine was slower on one day than on another. Less is better. A peer that is
not installed gives no value.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from math import nan
from time import process_time
from typing import Any, Final

from clustering import Presentations
from figures import Bench, Figure, medians
from peer import Peer
from planning_speed import Planning
from serial_line import Exchanges
from simulation import STEP, Simulation
from training_command import TrainingCommand

_ROUNDS: Final = 3
_CALLS: Final = 200_000

Medians = dict[str, dict[str, float]]
"""The median of each measured name, by its bench."""

Ratio = Callable[["Ratios", Medians], float]


class BareCalls:
    """Calls of a Python function that does nothing: the floor of all that is written in Python."""

    def __init__(self, _: ExitStack) -> None:
        pass

    def round(self) -> dict[str, float]:
        """Seconds of a call."""
        start = process_time()
        for _ in range(_CALLS):
            _nothing()
        return {"call": (process_time() - start) / _CALLS}

    def figures(self, _medians: Mapping[str, float]) -> list[Figure]:
        """Nothing by itself."""
        return []


def _nothing() -> None:
    pass


_BENCHES: Final[tuple[Callable[[ExitStack], Bench], ...]] = (
    BareCalls,
    Exchanges,
    Simulation,
    Peer,
    TrainingCommand,
    Presentations,
    Planning,
)


def over(unit: str) -> Callable[[Ratio], Ratio]:
    """Name what a ratio is taken over, where asv looks for its unit."""

    def named(ratio: Ratio) -> Ratio:
        marked: Any = ratio
        marked.unit = unit
        return ratio

    return named


class Ratios:
    """Tracked ratios: all is measured once a commit, and the ratios are taken from that."""

    timeout = 900
    version = "1"

    def setup_cache(self) -> Medians:
        """Measure all benches in turn."""
        with ExitStack() as stack:
            benches = [make(stack) for make in _BENCHES]
            found = medians(benches, range(_ROUNDS))
            return {type(b).__name__: each for b, each in zip(benches, found, strict=True)}

    @over("exchanges of a bare terminal")
    def track_exchange(self, found: Medians) -> float:
        """Return the time of an exchange, read in chunks."""
        each = found["Exchanges"]
        return each["bare chunk rate"] / each["robot chunk rate"]

    @over("exchanges of a bare terminal's process")
    def track_exchange_processor(self, found: Medians) -> float:
        """Return the time of an exchange, the processor time of the emulator's process."""
        each = found["Exchanges"]
        return each["robot cpu"] / each["bare cpu"]

    @over("bare Python calls")
    def track_step_away_from_walls(self, found: Medians) -> float:
        """Return the time of a step of 20 ms away from walls."""
        return self._simulated(found, "away from walls", STEP)

    @over("bare Python calls")
    def track_step_in_contact(self, found: Medians) -> float:
        """Return the time of a step of 20 ms, pushing at a wall."""
        return self._simulated(found, "always in contact with a wall", STEP)

    @over("bare Python calls")
    def track_step_with_sensors(self, found: Medians) -> float:
        """Return the time of a step of 20 ms at a wall, all sensors asked for."""
        return self._simulated(found, "at a wall, all eight sensors every 20 ms", STEP)

    @over("bare Python calls")
    def track_camera_frame(self, found: Medians) -> float:
        """Return the time of a camera frame, and the tenth of a second driven before it."""
        return self._simulated(found, "a camera frame at 10 Hz", 0.1)

    @over("steps of IR-SIM")
    def track_step_beside_irsim(self, found: Medians) -> float:
        """Return the time of a step of 20 ms with eight sensors."""
        each = found["Peer"]
        return each.get("other", nan) / each["own"]

    @over("bare Python calls")
    def track_training_command(self, found: Medians) -> float:
        """Return the time of a whole training command."""
        return found["TrainingCommand"]["command"] / found["BareCalls"]["call"]

    @over("NumPy passes over all nodes")
    def track_fuzzy_art(self, found: Medians) -> float:
        """Return the time of a presentation to Fuzzy ART, learning."""
        each = found["Presentations"]
        return each["learning"] / each["pass"]

    @over("presentations to artlib")
    def track_fuzzy_art_beside_artlib(self, found: Medians) -> float:
        """Return the time of a presentation to Fuzzy ART, learning."""
        each = found["Presentations"]
        return each["learning"] / each.get("peer", nan)

    @over("bare Python calls")
    def track_plan(self, found: Medians) -> float:
        """Return the time of a plan of the anticipative system in a map of 15,000 neurons."""
        return found["Planning"]["15000"] / found["BareCalls"]["call"]

    def _simulated(self, found: Medians, case: str, seconds: float) -> float:
        return seconds / found["Simulation"][case] / found["BareCalls"]["call"]
