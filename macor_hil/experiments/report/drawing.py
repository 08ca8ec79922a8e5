"""Drawing that the experiments' pictures share."""

from collections.abc import Mapping, Sequence

import numpy as np
from khepera_protocol.zenoh.payloads import Outline
from matplotlib.figure import Figure

from macor_hil.experiments.report.statistics import estimate
from macor_hil.monitor.pictures import draw_way
from macor_hil.runs.trials import MAX_COMMANDS, Trial


def draw_trials(trials: Mapping[str, tuple[Outline, Trial]]) -> Figure:
    """Ways side by side, the reinforcement of every command below each (figures 3 to 5)."""
    figure = Figure(figsize=(3.6 * len(trials), 5.2), layout="constrained")
    axes = figure.subplots(2, len(trials), squeeze=False, height_ratios=[4, 1], sharey="row")
    for column, (name, (outline, trial)) in enumerate(trials.items()):
        above, below = axes[0][column], axes[1][column]
        draw_way(above, outline, trial, width=0.8)
        end = "collision" if trial.collided else "no collision"
        above.set_title(f"{name}\n{trial.length} commands, {end}", fontsize=10)
        above.set_xlabel("x in m")
        below.bar(range(1, trial.length + 1), trial.reinforcement, width=0.8)
        most = max(MAX_COMMANDS, trial.length)
        below.set(xlabel="command", ylim=(0.0, 1.0), xlim=(0.0, most + 1.0))
        if column == 0:
            above.set_ylabel("y in m")
            below.set_ylabel("reinforcement")
    return figure


def draw_seeds(
    values: Mapping[str, Sequence[float]], label: str, paper: Mapping[str, float]
) -> Figure:
    """One dot a training seed, the interquartile mean with its interval, the paper's value."""
    figure = Figure(figsize=(1.7 * len(values) + 1.5, 4.2), layout="constrained")
    axes = figure.subplots()
    for place, (name, seeds) in enumerate(values.items()):
        # dots of equal values lie side by side, the same on every drawing
        aside = np.random.default_rng(0).uniform(-0.18, 0.18, len(seeds))
        axes.plot(place + aside, seeds, "o", color="tab:blue", alpha=0.4, markersize=5)
        middle = estimate(seeds)
        bars = [[middle.value - middle.low], [middle.high - middle.value]]
        axes.errorbar(place + 0.3, middle.value, np.abs(bars), fmt="s", color="black", capsize=4)
        if name in paper:
            axes.plot(place - 0.3, paper[name], "*", color="tab:red", markersize=11)
    axes.set_xticks(range(len(values)), list(values))
    axes.set_ylabel(label)
    axes.set_xlim(-0.6, len(values) - 0.4)
    axes.set_ylim(bottom=0.0)
    axes.plot([], [], "o", color="tab:blue", alpha=0.4, label="a training seed")
    axes.plot([], [], "s", color="black", label="interquartile mean, 95 %")
    if paper:
        axes.plot([], [], "*", color="tab:red", label="paper")
    axes.legend(fontsize=8)
    return figure
