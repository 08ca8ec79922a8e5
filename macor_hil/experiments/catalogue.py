"""All experiments, in the order of the report."""

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Final

from khepera_protocol.extras import how_to_install

from macor_hil.errors import MacorError
from macor_hil.experiments.beyond import BEYOND
from macor_hil.experiments.destinations import DESTINATIONS
from macor_hil.experiments.drift import DRIFT
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.goals import GOALS
from macor_hil.experiments.paper import table1
from macor_hil.experiments.paper.conditions import CONDITIONS
from macor_hil.experiments.paper.figure2 import FIGURE2
from macor_hil.experiments.paper.figure3 import FIGURE3
from macor_hil.experiments.paper.figure4 import FIGURE4
from macor_hil.experiments.paper.figure5 import FIGURE5
from macor_hil.experiments.paper.sensitivity.experiment import SENSITIVITY
from macor_hil.experiments.paper.table1 import TABLE1
from macor_hil.experiments.peers import PEERS
from macor_hil.experiments.suite.ablation import ABLATION
from macor_hil.experiments.suite.amounts import AMOUNTS
from macor_hil.experiments.suite.arenas import ARENAS

EXPERIMENTS: Final[tuple[Experiment, ...]] = (
    FIGURE2,
    FIGURE3,
    FIGURE4,
    CONDITIONS,
    TABLE1,
    FIGURE5,
    SENSITIVITY,
    BEYOND,
    GOALS,
    DESTINATIONS,
    DRIFT,
    ARENAS,
    AMOUNTS,
    ABLATION,
    PEERS,
)

ALL: Final = "all"


def find(name: str) -> tuple[Experiment, ...]:
    """Return the experiment of a name, or all that need no peer.

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


def with_planners(
    experiments: Sequence[Experiment], planners: Sequence[str]
) -> tuple[Experiment, ...]:
    """Return experiments in which table 1 has a row for each of other planners.

    Raises:
        MacorError: table 1 is not among them, or there is no such planner.
    """
    if planners and TABLE1.name not in {each.name for each in experiments}:
        raise MacorError(f"--planner adds rows to {TABLE1.name}; reproduce that")
    return tuple(
        table1.with_planners(each, planners) if each.name == TABLE1.name else each
        for each in experiments
    )
