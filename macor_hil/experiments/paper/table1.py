"""Table 1: reactive, anticipative and Q-learning systems compared (section 3.2).

One training drive a seed, 50 Fuzzy ART nodes, vigilance 0.9, three commands. All systems share
the situations; the reactive and the anticipative one share the map of equations 1 and 2, and
Q-learning has its own evaluations (equations 3 and 4). Beyond the paper: `expected` and `graded`,
and the paper's systems once more where a collision earns -1, as the printed means imply.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from macor_hil.errors import MacorError
from macor_hil.experiments.drives.course import Course, System, Track, on_course, trial_as_json
from macor_hil.experiments.drives.systems import (
    ANTICIPATIVE,
    EXPECTED,
    GRADED,
    REACTIVE,
    SYSTEMS,
    Learning,
    Q,
    learn_all,
)
from macor_hil.experiments.drives.training_drive import QUICK_DRIVE, Drive, Recordings
from macor_hil.experiments.experiment import Courses, Experiment
from macor_hil.experiments.paper import criteria
from macor_hil.experiments.paper.criteria import (
    PAPER,
    order_table,
    paper_table,
    per_seed,
    systems_of,
)
from macor_hil.experiments.paper.placing import DEFINITION, placing_table
from macor_hil.experiments.report.drawing import draw_seeds
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.rows import Row
from macor_hil.experiments.report.statistics import Order, estimate, order, too_few
from macor_hil.experiments.results.store import Result, Results
from macor_hil.mind.catalogue import make_planner
from macor_hil.mind.reinforcement import Reinforcement


@dataclass(frozen=True)
class Settings(Learning):
    """Section 3.2, with the paper's values."""

    drive: Drive = field(default_factory=Drive)
    """Training: "more than 10.000 typical sensorimotor situations"."""
    course: Course = field(default_factory=Course)
    """10 trials of at most 40 commands."""
    variant: Reinforcement = field(default_factory=lambda: Reinforcement(collision=-1.0))
    """Reinforcement under which the paper's systems learn and drive once more."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """The arenas of the trials."""
        return (self.course.arena,)


VARIED: Final = (REACTIVE, ANTICIPATIVE, Q)
"""The paper's systems, which drive under both reinforcements."""


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Learn all systems from the drive of a seed, and drive their trials."""
    recording = recordings[seed]
    systems = learn_all(settings, recording)
    others = learn_all(replace(settings, reinforcement=settings.variant), recording, VARIED)
    with on_course(settings.course, seed, settings.drive) as track:
        return {
            "outline": track.outline().model_dump(mode="json"),
            "robot_hours": round(recording.robot_seconds / 3600, 4),
            "transitions": systems[ANTICIPATIVE].brain.transitions,
            "trials": _driven(track, systems, seed),
            "variant": _driven(track, others, seed),
        }


def _driven(track: Track, systems: Mapping[str, System], seed: int) -> Result:
    """Return the trials of all systems, as they are kept."""
    return {
        name: [trial_as_json(one) for one in track.drive(system, seed)]
        for name, system in systems.items()
    }


@dataclass(frozen=True)
class PlannerSettings(Settings):
    """Section 3.2 with other planners."""

    planners: tuple[str, ...] = ()
    """Names, `module:Class` or `file.py:Class`."""


def trial_of_planners(settings: PlannerSettings, seed: int, recordings: Recordings) -> Result:
    """Drive trials of other planners on what the systems of the table have learned."""
    brain = learn_all(settings, recordings[seed])[ANTICIPATIVE].brain
    systems = {name: System(brain, make_planner(name)) for name in settings.planners}
    with on_course(settings.course, seed, settings.drive) as track:
        return {"trials": _driven(track, systems, seed)}


def with_planners(table: Experiment, planners: Sequence[str]) -> Experiment:
    """Return the table with a row for each of other planners, whose results are kept apart.

    Raises:
        MacorError: there is no such planner, or it reads a memory that is not learned here.
    """
    known = {field.name: getattr(table.settings, field.name) for field in fields(table.settings)}
    also = []
    learned = {make_planner(name).memory for name in SYSTEMS}
    for name in planners:
        if (memory := make_planner(name).memory) not in learned:
            raise MacorError(
                f"the planner {name} reads the memory {memory!r}, which the systems of the table do"
                f" not learn; they learn {', '.join(sorted(learned))}"
            )
        settings = PlannerSettings(**known, planners=(name,))
        also.append(
            Experiment(
                f"planner {name}",
                name,
                settings,
                trial_of_planners,
                lambda *_: {},
                lambda *_: (),
                results="planner",
            )
        )
    return replace(table, also=tuple(also))


CLAIMS: Final = ((ANTICIPATIVE, Q), (Q, REACTIVE))
"""The claims of the table: the first system of each pair is better than the second."""


def orders(results: Results, criterion: str) -> dict[str, Order]:
    """Return tests of the paper's ordering, and of the planners beyond it."""
    systems = systems_of(results)
    values = {system: per_seed(results, system)[criterion] for system in systems}
    pairs = (
        *CLAIMS,
        (ANTICIPATIVE, REACTIVE),
        (EXPECTED, ANTICIPATIVE),
        (GRADED, EXPECTED),
        *((other, ANTICIPATIVE) for other in systems if other not in SYSTEMS),
    )
    return {
        f"{a} over {b}": order(values[a], values[b]) for a, b in pairs if {a, b} <= values.keys()
    }


def under_variant(results: Results) -> Results:
    """Return the results of the paper's systems under the variant's reinforcement."""
    return {seed: {"trials": result["variant"]} for seed, result in results.items()}


def draw(_: Settings, results: Results) -> dict[str, Figure]:
    """Length of trials, seed by seed."""
    lengths = {system: per_seed(results, system)["length"] for system in systems_of(results)}
    paper = {name: row.length for name, row in PAPER.items()}
    return {"lengths": draw_seeds(lengths, "commands in a trial, mean of a seed's trials", paper)}


def tell(settings: Settings, results: Results) -> list[Element]:
    """Report the table in the paper's form, over seeds, and the test of the ordering."""
    other = under_variant(results)
    earns = _earns(settings.variant)
    return [
        Text(f"{_claim(settings, results)} {_scope(settings, results)}"),
        paper_table("Table 1 in the paper's form: all trials of all seeds", results),
        _seed_table(results),
        order_table("Test of the ordering", partial(orders, results)),
        Text(_length(results)),
        Picture("lengths", _caption(results)),
        Text(DEFINITION),
        placing_table(
            [(_earns(settings.reinforcement), results), (_earns(settings.variant), other)]
        ),
        Text(_implied(settings)),
        paper_table(f"Table 1 in the paper's form, {earns}", other),
        order_table(f"Test of the ordering, {earns}", partial(orders, other)),
        _all_seeds(results),
        Text(_DIFFERENCES),
    ]


def _earns(reinforcement: Reinforcement) -> str:
    return f"collision at {reinforcement.collision:g}"


def _claim(settings: Settings, results: Results) -> str:
    """Return a sentence: whether the table's claim holds here, and under what conditions."""
    drive = settings.drive
    usual, other = _held(results), _held(under_variant(results))
    at = settings.variant.collision
    outcome = f"{usual} with a {_earns(settings.reinforcement)}"
    outcome += f" and at {at:g} alike" if usual == other else f" and {other} at {at:g}"
    return (
        f"The table's claim, {ANTICIPATIVE} over {Q} over {REACTIVE}, {outcome},"
        f" in {len(results)} trainings of {drive.random + drive.reactive:,}"
        f" commands{_of_robots(drive)} in the arena {drive.arena},"
        f" with {settings.nodes} nodes and vigilance {settings.vigilance:g}."
        f"{too_few(len(results))}"
    )


def _of_robots(drive: Drive) -> str:
    """Return which robots, if they are not the paper's."""
    return "" if drive.model == Drive.model else f" of robots of the model {drive.model}"


def _held(results: Results) -> str:
    """Return whether the claim holds in length and reinforcement, as the end of a sentence."""
    missing = {
        label: [name for name in _CLAIMED if not orders(results, criterion)[name].holds]
        for criterion, label in (("length", "length"), ("r", "reinforcement"))
    }
    held = [label for label, names in missing.items() if not names]
    lacking = [
        f"in {label} (missing: {'; '.join(names)})" for label, names in missing.items() if names
    ]
    if not held:
        return f"is shown neither {' nor '.join(lacking)}"
    return f"holds in {' and '.join(held)}" + "".join(f" but is not shown {x}" for x in lacking)


_CLAIMED: Final = tuple(f"{a} over {b}" for a, b in CLAIMS)


def _scope(settings: Settings, results: Results) -> str:
    hours = np.mean([result["robot_hours"] for result in results.values()])
    drive = settings.drive
    return (
        f"Each training seed is another robot; {drive.random:,} random and {drive.reactive:,}"
        f" reactive commands each ({hours:.1f} hours of the robot's time; the paper's robot needed"
        f" about 6.5); {settings.course.trials} trials of at most {settings.course.commands}"
        " commands of every system and seed."
    )


def _seed_table(results: Results) -> Table:
    rows = []
    for system in systems_of(results):
        values = per_seed(results, system)
        rows.append((system, *(str(estimate(values[c])) for c in ("r", "length", "step"))))
    head = ("system", "r per trial", "length", "r per step")
    return Table("Interquartile mean over seeds (95 % bootstrap interval)", head, tuple(rows))


def _caption(results: Results) -> str:
    lengths = per_seed(results, ANTICIPATIVE)["length"]
    return (
        "Mean length of each seed's trials. The reactive system's seeds lie together; those of the"
        f" {ANTICIPATIVE} one go from {min(lengths):.1f} to {max(lengths):.1f} commands, so one"
        " training tells little about it."
    )


def _length(results: Results) -> str:
    length = estimate(per_seed(results, ANTICIPATIVE)["length"])
    return (
        f"The {ANTICIPATIVE} system's trials are {length} commands long (paper:"
        f" {PAPER[ANTICIPATIVE].length}, one training)."
    )


def _implied(settings: Settings) -> str:
    """Tell what a collision earns in the paper, by its row of the reactive system."""
    row = PAPER[REACTIVE]
    implied = row.r - row.step * (row.length - 1)
    return (
        f"The paper's {REACTIVE} system earns {row.r} in {row.length} commands and {row.step} in"
        f" each but the last, which collides; the collision then earns about {implied:.1f}. So the"
        f" paper's systems learn and drive from the same recordings once more, with a"
        f" {_earns(settings.variant)}."
    )


def _all_seeds(results: Results) -> Table:
    systems = systems_of(results)
    lengths = {system: per_seed(results, system)["length"] for system in systems}
    rows = tuple(
        (str(seed), *(f"{lengths[system][k]:.1f}" for system in systems))
        for k, seed in enumerate(results)
    )
    return Table("Mean length of the trials of every seed", ("seed", *systems), rows)


_DIFFERENCES: Final = (
    "Differences from the paper: its numbers are 10 trials of a single training of one physical"
    " robot, whose 4 anticipative collisions it explains by the fixing of the camera. Here the"
    " robot is emulated, each seed is another robot with another training, and starts vary a"
    " little. The corridor's measures, the receptive fields, the reinforcement's two values and"
    " the greatest competence are not printed and were chosen (docs/design.md). All systems"
    " learn from the same drive, random commands alone."
)


def rows(settings: Settings, results: Results) -> Iterator[Row]:
    """Yield one row for each trial; systems of the variant have a name of their own."""
    yield from criteria.rows(settings, results)
    for row in criteria.rows(settings, under_variant(results)):
        yield {**row, "system": f"{row['system']}, {_earns(settings.variant)}"}


def courses(settings: Settings, _: Path) -> dict[str, Course]:
    """Return the course of all trials."""
    return {settings.course.place: settings.course}


def driven(settings: Settings, result: Result) -> dict[str, dict[str, Any]]:
    """Return the trials; systems of the variant have a name of their own."""
    earns = _earns(settings.variant)
    others = {f"{name}, {earns}": trials for name, trials in result["variant"].items()}
    return {settings.course.place: {**result["trials"], **others}}


QUICK: Final = Settings(drive=QUICK_DRIVE, course=Course(trials=3))

TABLE1: Final = Experiment(
    "table1",
    "Table 1: reactive, anticipative and Q-learning systems",
    Settings(),
    trial,
    draw,
    tell,
    quick=QUICK,
    rows=rows,
    courses=Courses(courses, driven),
)
