"""Drawing that the experiments' pictures share."""

from collections.abc import Mapping, Sequence

import numpy as np
from khepera_protocol import palette
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from macor_hil.experiments.report.statistics import Estimate, estimate


def draw_interval(
    axes: Axes, places: Sequence[float], found: Sequence[Estimate], name: str, number: int
) -> None:
    """Draw a curve over seeds with a band for its intervals.

    Args:
        axes: to draw into.
        places: along the axis, one for each estimate.
        found: the curve.
        name: in the legend.
        number: of the curve, which gives its colour and marker.
    """
    colour, marker = palette.SERIES[number], palette.MARKERS[number]
    axes.plot(places, [one.value for one in found], marker=marker, color=colour, label=name)
    low, high = [one.low for one in found], [one.high for one in found]
    axes.fill_between(places, low, high, color=colour, alpha=0.2, linewidth=0.0)


def begin_at_zero(axes: Axes) -> None:
    """Let the axis of values begin at 0, with room above what is drawn."""
    axes.set_ylim(0.0, 1.06 * float(axes.dataLim.ymax))


def draw_seeds(
    values: Mapping[str, Sequence[float]], label: str, paper: Mapping[str, float]
) -> Figure:
    """One dot a training seed, the interquartile mean with its interval, the paper's value."""
    figure = Figure(figsize=(1.75 * len(values) + 1.0, 4.8), layout="constrained")
    axes = figure.subplots()
    for place, (name, seeds) in enumerate(values.items()):
        # dots of equal values lie side by side, the same on every drawing
        aside = np.random.default_rng(0).uniform(-0.18, 0.18, len(seeds))
        axes.plot(place + aside, seeds, "o", color=palette.BLUE, alpha=0.45, markersize=7)
        middle = estimate(seeds)
        bars = [[middle.value - middle.low], [middle.high - middle.value]]
        axes.errorbar(
            place + 0.32,
            middle.value,
            np.abs(bars),
            fmt="s",
            color=palette.BLACK,
            markersize=8,
            capsize=6,
        )
        if name in paper:
            axes.plot(place - 0.32, paper[name], "*", color=palette.VERMILION, markersize=15)
    axes.set_xticks(range(len(values)), list(values))
    axes.set_ylabel(label)
    axes.set_xlim(-0.6, len(values) - 0.4)
    begin_at_zero(axes)
    axes.grid(axis="y")
    axes.plot([], [], "o", color=palette.BLUE, alpha=0.45, markersize=7, label="a training seed")
    axes.plot([], [], "s", color=palette.BLACK, label="interquartile mean, 95 % interval")
    if paper:
        axes.plot([], [], "*", color=palette.VERMILION, markersize=15, label="paper")
    figure.legend(loc="outside lower center", ncols=3)
    return figure
