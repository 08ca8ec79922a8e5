"""`make bench`: figures of the serial line, the simulation and the controller, as ratios.

Everything is measured in several rounds, in turn, and the medians are taken: a machine that is
slower for a while is slower for both sides of a ratio. `service.py` measures the live service.
"""

import os
import platform
from collections.abc import Callable
from contextlib import ExitStack
from importlib.metadata import version

from clustering import Presentations
from epuck_line import EpuckLine
from figures import Bench, Figure, medians
from page import DOCS, report
from peer import Peer
from planning_speed import Planning
from rich.progress import track
from serial_line import Exchanges, WireTime
from simulation import Fleets, Simulation
from training_command import TrainingCommand

_ROUNDS = 5
_BENCHES: tuple[Callable[[ExitStack], Bench], ...] = (
    Exchanges,
    WireTime,
    EpuckLine,
    Simulation,
    Fleets,
    Peer,
    TrainingCommand,
    Presentations,
    Planning,
)
_HEAD = ("figure", "measured", "against, or made of", "ratio")


def main() -> None:
    """Measure, and print the table; with `--write` put it into docs/benchmarks.md, too."""
    figures = measure()
    report("benchmarks", _HEAD, figures, (DOCS / "benchmarks.md", "table"), _machine())


def measure() -> list[Figure]:
    """All rounds of all benchmarks."""
    with ExitStack() as stack:
        benches = [make(stack) for make in _BENCHES]
        found = medians(benches, track(range(_ROUNDS), "rounds", transient=True))
        return [
            figure
            for bench, each in zip(benches, found, strict=True)
            for figure in bench.figures(each)
        ]


def _machine() -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in ("pybullet", "numpy", "pyserial"))
    return (
        f"One run, medians of {_ROUNDS} rounds; {os.cpu_count()} {platform.machine()} cores,"
        f" load average {os.getloadavg()[1]:.1f}, CPython {platform.python_version()}, {packages}."
    )


if __name__ == "__main__":
    main()
