"""All experiments, in the order of the report."""

from dataclasses import replace
from importlib.util import find_spec
from typing import Final

from khepera_protocol.extras import how_to_install

from macor_hil.errors import MacorError
from macor_hil.experiments.arenas import ARENAS
from macor_hil.experiments.beyond import BEYOND
from macor_hil.experiments.drift import DRIFT
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.figure2 import FIGURE2
from macor_hil.experiments.figure3 import FIGURE3
from macor_hil.experiments.figure4 import FIGURE4
from macor_hil.experiments.goals import GOALS
from macor_hil.experiments.peers import PEERS
from macor_hil.experiments.table1 import FIGURE5, TABLE1

EXPERIMENTS: Final[tuple[Experiment, ...]] = (
    FIGURE2,
    FIGURE3,
    FIGURE4,
    TABLE1,
    FIGURE5,
    BEYOND,
    GOALS,
    DRIFT,
    ARENAS,
    PEERS,
)

ALL: Final = "all"


def find(name: str) -> tuple[Experiment, ...]:
    """The experiment of a name, or all that need no peer.

    Raises:
        MacorError: there is none of that name, or its peer is not installed.
    """
    found = tuple(e for e in EXPERIMENTS if name == e.name or (name == ALL and e.peer is None))
    if not found:
        names = ", ".join([*(e.name for e in EXPERIMENTS), ALL])
        raise MacorError(f"there is no experiment {name!r}; give one of {names}")
    for experiment in found:
        if experiment.peer is not None and find_spec(experiment.peer) is None:
            raise MacorError(
                f"{experiment.peer} is not installed; install the extra 'peers' with:"
                f" {how_to_install('peers')}"
            )
    return found


def quick(experiments: tuple[Experiment, ...]) -> tuple[Experiment, ...]:
    """Return experiments with settings that take minutes.

    Raises:
        MacorError: one of them has none.
    """
    for experiment in experiments:
        if experiment.quick is None:
            able = ", ".join(e.name for e in EXPERIMENTS if e.quick is not None)
            raise MacorError(f"{experiment.name} has no quick form; these have: {able}")
    return tuple(replace(experiment, settings=experiment.quick) for experiment in experiments)
