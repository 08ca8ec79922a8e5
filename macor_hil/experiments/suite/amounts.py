"""Success against the number of situations, and against the number of training commands.

Offline but for the trials: all systems learn from the recordings of the suite's arenas. Expected
values, over Fuzzy ART's nodes and over graded prototypes, learn with fewer and with more situations
than the paper's fifty; foresight, which has no situations, with fewer commands.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from macor_hil.experiments.drives.arena_files import Place
from macor_hil.experiments.drives.course import Course, System
from macor_hil.experiments.drives.systems import (
    EXPECTED,
    FORESIGHT,
    GRADED,
    learn_foresight,
    learn_situations,
)
from macor_hil.experiments.drives.training_drive import QUICK_DRIVE, Recording, Recordings
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.report.drawing import draw_interval
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.rows import Row
from macor_hil.experiments.report.statistics import estimate, mean
from macor_hil.experiments.results.store import Result, Results
from macor_hil.experiments.suite.in_place import InPlace, by_arena, driven, drives, parts
from macor_hil.experiments.suite.shares import (
    HOW_TO_READ,
    cell,
    compared_rows,
    shares_by_seed,
)


@dataclass(frozen=True)
class Settings(InPlace):
    """The amounts that are tried."""

    situations: tuple[int, ...] = (20, 50, 100, 200)
    """Numbers of situations that expected values are learned with, from the whole drive."""
    commands: tuple[int, ...] = (250, 500, 1_000, 3_000, 13_000)
    """Numbers of commands, from the drive's beginning on, that foresight learns from."""

    @property
    def amounts(self) -> tuple[tuple[str, int], ...]:
        """Every system with its amount."""
        by_situations = ((name, n) for name in (EXPECTED, GRADED) for n in self.situations)
        return (*by_situations, *((FORESIGHT, n) for n in self.commands))


UNIT: Final = {EXPECTED: "situations", GRADED: "situations", FORESIGHT: "training commands"}


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Learn with all amounts from the drives of a seed, and drive the trials."""
    return driven(settings, seed, recordings, _systems)


def _systems(settings: Settings, recording: Recording, seed: int) -> dict[str, System]:
    systems: dict[str, System] = {}
    for nodes in settings.situations:
        rng = np.random.default_rng([seed, nodes])
        learned = learn_situations(replace(settings, nodes=nodes), recording, rng)
        systems |= {_name(name, nodes): system for name, system in learned.items()}
    for commands in settings.commands:
        learned_early = learn_foresight(settings, recording.first(commands))
        systems[_name(FORESIGHT, commands)] = learned_early
    return {_name(*amount): systems[_name(*amount)] for amount in settings.amounts}


def _name(system: str, amount: int) -> str:
    return f"{system}, {amount:,} {UNIT[system]}"


def rows(settings: Settings, results: Results) -> Iterator[Row]:
    """Yield one row for each trial."""
    for seed, result in results.items():
        for one in result["driven"]:
            where = {"arena": one["arena"], "look": one["look"], "seed": seed}
            for system, amount in settings.amounts:
                what: Row = {"system": system, "unit": UNIT[system], "amount": amount}
                yield from compared_rows(one, _name(system, amount), {**where, **what})


def draw(settings: Settings, results: Results) -> dict[str, Figure]:
    """Draw the share of what was possible against the amounts, one panel for each arena."""
    groups = by_arena(results)
    figure = Figure(figsize=(4.0 * len(groups), 6.6), layout="constrained")
    axes = figure.subplots(2, len(groups), squeeze=False, sharey=True)
    for column, (name, conditions) in enumerate(groups.items()):
        for row, shown in enumerate(((EXPECTED, GRADED), (FORESIGHT,))):
            panel = axes[row][column]
            for system in shown:
                amounts = [amount for each, amount in settings.amounts if each == system]
                found = [
                    estimate(
                        [100 * x for x in shares_by_seed(conditions, _name(system, amount))[0]],
                        mean,
                    )
                    for amount in amounts
                ]
                draw_interval(panel, amounts, found, system, list(UNIT).index(system))
            panel.set(xscale="log", xlabel=UNIT[shown[0]], ylim=(0.0, 105.0))
            panel.set_xticks(amounts, [f"{amount:,}" for amount in amounts], rotation=30)
            panel.minorticks_off()
            panel.grid()
        axes[0][column].set_title(name)
    for left in axes[:, 0]:
        left.set_ylabel("% of what was possible")
    shown_by = [axes[row][0].get_legend_handles_labels() for row in (0, 1)]
    handles, names = (upper + lower for upper, lower in zip(*shown_by, strict=True))
    figure.legend(handles, names, loc="outside lower center", ncols=3)
    return {"shares": figure}


def tell(settings: Settings, results: Results) -> list[Element]:
    """Tell what each amount gives."""
    return [
        Text(
            f"{len(results)} training seeds, each another robot; {settings.drive.random:,} random"
            f" commands of training, trained and driven in the same arena;"
            f" {settings.course.trials} trials of at most {settings.course.commands} commands."
            f" {HOW_TO_READ}"
        ),
        _table(
            f"Number of situations, after {settings.drive.random:,} commands",
            settings,
            results,
            (EXPECTED, GRADED),
        ),
        _table("Number of training commands, without situations", settings, results, (FORESIGHT,)),
        Picture("shares", _caption(settings, results)),
    ]


def _caption(settings: Settings, results: Results) -> str:
    """Tell the worst arena of each system, with most of what it learns from."""
    worst = {}
    for system in UNIT:
        most = max(amount for name, amount in settings.amounts if name == system)
        shares = {
            arena: float(np.mean(shares_by_seed(conditions, _name(system, most))[0]))
            for arena, conditions in by_arena(results).items()
        }
        arena = min(shares, key=shares.__getitem__)
        worst[_name(system, most)] = f"{100 * shares[arena]:.0f} % in {arena}"
    return (
        "Mean over seeds; bands: 95 % interval. Above by the number of situations, below by that of"
        " training commands. Even with the most of them the least share of an arena is"
        f" {'; '.join(f'{share} ({name})' for name, share in worst.items())}."
    )


def _table(title: str, settings: Settings, results: Results, systems: tuple[str, ...]) -> Table:
    groups = by_arena(results)
    lines = tuple(
        (name, *(cell(conditions, name) for conditions in groups.values()))
        for system, amount in settings.amounts
        if system in systems
        for name in [_name(system, amount)]
    )
    return Table(title, ("system", *groups), lines)


QUICK: Final = Settings(
    drive=QUICK_DRIVE,
    homes=(Place("corridor"), Place("maze")),
    situations=(20, 50, 100),
    commands=(250, 1_500),
    course=Course(trials=3),
)

AMOUNTS: Final = Experiment(
    "amounts",
    "Success against the number of situations and of training commands",
    Settings(),
    trial,
    draw,
    tell,
    most_seeds=10,
    quick=QUICK,
    rows=rows,
    drives=drives,
    parts=parts,
)
