"""Figure 5: ways of the systems of table 1, from the same trials."""

from math import pi
from typing import Final

import numpy as np
from khepera_protocol.zenoh.payloads import Outline
from matplotlib.figure import Figure

from macor_hil.experiments.drives.course import trial_from_json
from macor_hil.experiments.drives.systems import ANTICIPATIVE, EXPECTED, GRADED, REACTIVE, Q
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.paper.criteria import per_seed, trials_of
from macor_hil.experiments.paper.table1 import QUICK, Settings, trial
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.results.store import Results
from macor_hil.monitor.pictures import trials_figure
from macor_hil.runs.trials import Trial

ROUND: Final = "no collision"
BEGUN: Final = "collision after half of the curve"
STRAIGHT: Final = "collision before"
WAYS: Final = (ROUND, BEGUN, STRAIGHT)

CLAIMED: Final = {REACTIVE: STRAIGHT, ANTICIPATIVE: ROUND, Q: BEGUN}
"""The way of each system in the paper's figure."""

_HALF: Final = 45.0
"""Degrees to the left of the start's heading: half of the corridor's curve."""


def way_of(trial: Trial) -> str:
    """Return how a trial took the corridor's curve, which is to the left."""
    if not trial.collided:
        return ROUND
    headings = np.unwrap([pose.heading for pose in trial.path])
    turned = float(headings.max() - headings[0]) * 180.0 / pi
    return BEGUN if turned >= _HALF else STRAIGHT


def usual_way(trials: list[Trial]) -> str | None:
    """Return the way of more than half of some trials; None if no way is."""
    ways = [way_of(one) for one in trials]
    return next((way for way in WAYS if 2 * ways.count(way) > len(ways)), None)


def typical_seed(results: Results) -> int:
    """Return the seed whose anticipative trials are of median length, the lower one of two."""
    lengths = per_seed(results, ANTICIPATIVE)["length"]
    middle = np.argsort(lengths, kind="stable")[(len(lengths) - 1) // 2]
    return list(results)[int(middle)]


def draw(_: Settings, results: Results) -> dict[str, Figure]:
    """One trial of each system on the typical seed: the one of median length."""
    return {"trajectories": trials_figure(_shown(results))}


def _shown(results: Results) -> dict[str, tuple[Outline, Trial]]:
    """Return the trial of median length of each system, on the typical seed."""
    result = results[typical_seed(results)]
    outline = Outline.model_validate(result["outline"])
    shown = {}
    for system in (REACTIVE, ANTICIPATIVE, Q, EXPECTED, GRADED):
        trials = [trial_from_json(value) for value in result["trials"][system]]
        ordered = sorted(trials, key=lambda t: t.length)
        shown[system] = outline, ordered[(len(ordered) - 1) // 2]
    return shown


def tell(settings: Settings, results: Results) -> list[Element]:
    """Report the picture, and how many trainings drive as it does."""
    seed = typical_seed(results)
    return [
        Text(_claim(settings, results)),
        _table(results),
        Text(
            f"Shown is training seed {seed}, the one whose {ANTICIPATIVE} trials are of median"
            f" length among {len(results)}, and of each system the trial of median length among"
            f" its {settings.course.trials}. The trials are those of table 1."
        ),
        Picture("trajectories", _caption(results)),
        Text(
            f"In the paper the {ANTICIPATIVE} system turns left as soon as the curve is in sight"
            f" and gets round it, the {REACTIVE} one drives straight on into the wall, and {Q} gets"
            " round the curve's beginning and then drives into a wall straight on."
        ),
    ]


def _caption(results: Results) -> str:
    unhurt = [name for name, (_, one) in _shown(results).items() if not one.collided]
    return (
        "Circles: the robot after each command, filled at the start, crossed out at a collision;"
        f" below: what each command earned. Round the curve: {' and '.join(unhurt) or 'nobody'}."
    )


def _claim(settings: Settings, results: Results) -> str:
    """Return a sentence: whether the figure's claim holds here, and under what conditions."""
    usual = {name: [usual_way(trials) for trials in trials_of(results, name)] for name in CLAIMED}
    alike = {name: sum(way == CLAIMED[name] for way in usual[name]) for name in CLAIMED}
    together = sum(
        all(usual[name][k] == way for name, way in CLAIMED.items()) for k in range(len(results))
    )
    count = len(results)
    if together == count:
        outcome = "holds here in all"
    elif together:
        outcome = f"holds here in {together} of"
    else:
        outcome = "holds here in none of"
    systems = ", ".join(f"{name} in {alike[name]}" for name in CLAIMED)
    drive = settings.drive
    return (
        f"The figure's claim, that {REACTIVE} drives into the wall, {ANTICIPATIVE} gets round the"
        f" curve and {Q} collides within it, {outcome} {count} trainings of"
        f" {drive.random + drive.reactive:,} commands in the arena {drive.arena}, with"
        f" {settings.nodes} nodes and vigilance {settings.vigilance:g}; each by itself: {systems}."
        " A system drives as in the figure where more than half of its trials do."
    )


def _table(results: Results) -> Table:
    rows = []
    for name, claimed in CLAIMED.items():
        ways = [way_of(one) for trials in trials_of(results, name) for one in trials]
        shares = (f"{100 * ways.count(way) / len(ways):.0f} %" for way in WAYS)
        rows.append((name, *shares, claimed))
    return Table(
        f"Ways of all trials; half of the curve: {_HALF:g} degrees to the left",
        ("system", *WAYS, "paper"),
        tuple(rows),
    )


FIGURE5: Final = Experiment(
    "figure5",
    "Figure 5: ways of the systems",
    Settings(),
    trial,
    draw,
    tell,
    results="table1",
    quick=QUICK,
)
