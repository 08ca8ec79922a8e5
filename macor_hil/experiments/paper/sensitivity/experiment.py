"""The map as an experiment."""

from typing import Final

from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.paper.sensitivity.driving import trial
from macor_hil.experiments.paper.sensitivity.outcomes import rows
from macor_hil.experiments.paper.sensitivity.pages import draw, tell
from macor_hil.experiments.paper.sensitivity.points import QUICK, Settings

SENSITIVITY: Final = Experiment(
    "sensitivity",
    "Sensitivity: table 1 under other settings",
    Settings(),
    trial,
    draw,
    tell,
    most_seeds=10,
    quick=QUICK,
    rows=rows,
)
