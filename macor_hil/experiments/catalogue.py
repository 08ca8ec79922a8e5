"""All experiments, in the order of the report."""

from typing import Final

from macor_hil.errors import MacorError
from macor_hil.experiments.beyond import BEYOND
from macor_hil.experiments.drift import DRIFT
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.figure2 import FIGURE2
from macor_hil.experiments.figure3 import FIGURE3
from macor_hil.experiments.figure4 import FIGURE4
from macor_hil.experiments.goals import GOALS
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
)

ALL: Final = "all"


def find(name: str) -> tuple[Experiment, ...]:
    """The experiment of a name, or all of them.

    Raises:
        MacorError: there is none of that name.
    """
    found = tuple(e for e in EXPERIMENTS if name in (e.name, ALL))
    if not found:
        names = ", ".join([*(e.name for e in EXPERIMENTS), ALL])
        raise MacorError(f"there is no experiment {name!r}; give one of {names}")
    return found
