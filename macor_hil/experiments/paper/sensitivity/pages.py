"""The map's page: heat maps and curves of mean lengths, tables, and where the orderings hold."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from khepera_protocol import palette
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from macor_hil.experiments.drives.systems import ANTICIPATIVE, REACTIVE, Q
from macor_hil.experiments.paper.sensitivity.driving import SYSTEMS
from macor_hil.experiments.paper.sensitivity.outcomes import (
    LABELS,
    Map,
    Outcome,
    named,
    orders,
    outcomes,
    shown,
)
from macor_hil.experiments.paper.sensitivity.points import Axis, Grid, Point, Settings
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.statistics import Order, holm, too_few
from macor_hil.experiments.results.store import Results

Values = tuple[str, ...]
"""Values of a point, as its row of a table begins."""


def draw(settings: Settings, results: Results) -> dict[str, Figure]:
    """Draw a heat map for each grid, and the curves of what is varied alone."""
    found = outcomes(results)
    pictures = {_name(grid): _heat(settings, grid, found) for grid in settings.grids}
    if settings.lines:
        pictures["lines"] = _curves(settings, found)
    return pictures


def _name(grid: Grid) -> str:
    return f"{grid.rows.name}-{grid.columns.name}"


def _heat(settings: Settings, grid: Grid, found: Map) -> Figure:
    """Mean length of each system, with the share of trials that collided below the number."""
    points = grid.at(settings.base)
    figure = Figure(figsize=(3.6 * len(SYSTEMS) + 1.0, 4.4), layout="constrained")
    all_axes = figure.subplots(1, len(SYSTEMS), squeeze=False)[0]
    most = float(settings.course.commands)
    shape = len(grid.rows.values), len(grid.columns.values)
    image = None
    for axes, name in zip(all_axes, SYSTEMS, strict=True):
        here = [found[point][name] for point in points.values()]
        lengths = np.array([np.mean(one.length) for one in here]).reshape(shape)
        image = axes.imshow(lengths, vmin=0.0, vmax=most, aspect="auto")
        for place, one in zip(np.ndindex(shape), here, strict=True):
            length = float(lengths[place])
            colour = "black" if length > 0.6 * most else "white"
            text = f"{length:.1f}\n{100 * np.mean(one.collided):.0f} %"
            row, column = place
            axes.text(column, row, text, ha="center", va="center", color=colour)
        axes.set_xticks(range(shape[1]), [shown(value) for value in grid.columns.values])
        axes.set_yticks(range(shape[0]), [shown(value) for value in grid.rows.values])
        axes.set_xlabel(LABELS[grid.columns.name])
        axes.set_title(name)
    all_axes[0].set_ylabel(LABELS[grid.rows.name])
    if image is not None:
        figure.colorbar(image, ax=list(all_axes), label="commands in a trial, mean")
    return figure


def _curves(settings: Settings, found: Map) -> Figure:
    """Mean length over what is varied alone, with 95 % intervals."""
    columns = min(3, len(settings.lines))
    count = -(-len(settings.lines) // columns)
    figure = Figure(figsize=(4.0 * columns, 3.4 * count), layout="constrained")
    all_axes = figure.subplots(count, columns, squeeze=False, sharey=True).flat
    for axes, line in zip(all_axes, settings.lines, strict=False):
        _curve(axes, settings.base, line, found)
    for axes in list(all_axes)[len(settings.lines) :]:
        axes.set_axis_off()
    first = figure.axes[0]
    first.set_ylim(0.0, settings.course.commands + 2.0)
    figure.legend(*first.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    for axes in figure.axes[::columns]:
        axes.set_ylabel("commands in a trial, mean")
    return figure


def _curve(axes: Axes, base: Point, line: Axis, found: Map) -> None:
    places = np.arange(len(line.values))
    for aside, marker, name in zip((-0.08, 0.0, 0.08), palette.MARKERS, SYSTEMS, strict=False):
        means = [found[line.at(base, value)][name].mean_length() for value in line.values]
        middle = [one.value for one in means]
        bars = [[one.value - one.low for one in means], [one.high - one.value for one in means]]
        axes.errorbar(places + aside, middle, np.abs(bars), marker=marker, capsize=4, label=name)
    axes.set_xticks(places, [shown(value) for value in line.values])
    axes.set_xlabel(LABELS[line.name])


def tell(settings: Settings, results: Results) -> list[Element]:
    """Report where the paper's orderings hold, and what comes out at every point."""
    found = outcomes(results)
    blocks: list[Element] = [
        Text(f"{_claim(settings, found)}{too_few(len(results))}"),
        Text(f"{_reinforcement(settings, found)}{too_few(len(results), len(found))}"),
        Text(_scope(settings, results)),
    ]
    for grid in settings.grids:
        points: dict[Values, Point] = {
            tuple(map(shown, values)): point for values, point in grid.at(settings.base).items()
        }
        heads = LABELS[grid.rows.name], LABELS[grid.columns.name]
        blocks += [
            Picture(_name(grid), _caption(points, found)),
            _table(heads, points, found),
        ]
    if settings.lines:
        blocks.append(Picture("lines", _LINES))
    for line in settings.lines:
        on_line: dict[Values, Point] = {
            (shown(value),): line.at(settings.base, value) for value in line.values
        }
        blocks.append(_table((LABELS[line.name],), on_line, found))
    return blocks


def _caption(points: Mapping[Values, Point], found: Map) -> str:
    longest = []
    for name in SYSTEMS:
        lengths = [float(np.mean(found[point][name].length)) for point in points.values()]
        at = list(points)[int(np.argmax(lengths))]
        longest.append(f"{name} at {' and '.join(at)}")
    return (
        "Mean length of trials, the brighter the longer; below it the share that collided. Longest"
        f" trials: {'; '.join(longest)}."
    )


_LINES: Final = (
    "Each setting varied alone: mean length of trials, bars: 95 % interval over seeds. Where bars"
    " overlap, these seeds do not show that the setting matters."
)


def _table(heads: Sequence[str], points: Mapping[Values, Point], found: Map) -> Table:
    tests = orders(found, Q, REACTIVE, "r")
    rows = tuple(
        (*values, *(_cell(found[point][name]) for name in SYSTEMS), *_test(tests[point]))
        for values, point in points.items()
    )
    title = (
        f"By {' and '.join(heads)}: length, mean over seeds (95 % bootstrap interval), and trials"
        " that collided"
    )
    return Table(title, (*heads, *SYSTEMS, f"{Q} over {REACTIVE} in r", "p"), rows)


def _cell(outcome: Outcome) -> str:
    length = outcome.mean_length()
    collided = 100 * np.mean(outcome.collided)
    return f"{length.value:.1f} ({length.low:.1f} to {length.high:.1f}); {collided:.0f} %"


def _test(test: Order) -> tuple[str, str]:
    return str(test.difference), f"{test.p:.4f}"


def _claim(settings: Settings, found: Map) -> str:
    """Return a sentence: where the paper's ordering holds as a whole."""
    said = []
    for criterion, label in (("length", "length"), ("r", "reinforcement")):
        first, second = (
            orders(found, better, worse, criterion)
            for better, worse in ((ANTICIPATIVE, Q), (Q, REACTIVE))
        )
        held = [point for point in found if first[point].holds and second[point].holds]
        where = "" if not held else f" ({_list(held, settings.base)})"
        said.append(f"in {label} in {len(held)} of {len(found)} settings{where}")
    return (
        f"The ordering of table 1, {ANTICIPATIVE} over {Q} over {REACTIVE}, holds here"
        f" {' and '.join(said)}, each by itself at 5 %."
    )


def _reinforcement(settings: Settings, found: Map) -> str:
    """Return sentences: where Q-learning over reactive holds in reinforcement."""
    tests = orders(found, Q, REACTIVE, "r")
    held = [point for point, test in tests.items() if test.holds]
    kept = holm([test.p for test in tests.values()])
    sure = [point for point, right in zip(tests, kept, strict=True) if right]
    sure = [point for point in sure if tests[point].holds]
    if not held:
        return (
            f"{Q} over {REACTIVE} in reinforcement is shown in none of {len(tests)} settings, each"
            " by itself at 5 %."
        )
    rest = f"in {len(sure)}: {_list(sure, settings.base)}" if sure else "in none"
    return (
        f"{Q} over {REACTIVE} in reinforcement is shown in {len(held)} of {len(tests)} settings,"
        f" each by itself at 5 %: {_list(held, settings.base)}. With Holm's correction for"
        f" {len(tests)} tests it is shown {rest}."
    )


def _list(points: list[Point], base: Point) -> str:
    return "; ".join(named(point, base) for point in points)


def _scope(settings: Settings, results: Results) -> str:
    base = settings.base
    return (
        f"{len(results)} training seeds, each another robot, from whose recorded drive of"
        f" {base.commands:,} commands every setting learns; {settings.course.trials} trials of at"
        f" most {settings.course.commands} commands of each system. Where nothing else is said:"
        f" vigilance {base.vigilance:g}, {base.nodes} nodes, greatest competence {base.w_max:g}, mu"
        f" {base.mu:g}, gamma {base.gamma:g}, a turn earns {base.turn:g} and a collision"
        f" {base.collision:g}, in the corridor of {base.width:g} m whose end wall is"
        f" {base.distance:g} m from the start. Corridors of other measures are driven with what was"
        " learned in that one; training in each of them was not tried, as it needs a drive for"
        " each width and seed."
    )
