"""A picture of a whole suite: what every system drives of what is possible, in every arena."""

from collections.abc import Mapping, Sequence
from math import ceil, floor
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from macor_hil.experiments.results.store import Result
from macor_hil.experiments.suite.shares import shares_by_seed

HOW_TO_READ_MAP: Final = (
    "Number and colour: mean share of the commands that were possible, in per cent, rounded down;"
    " in brackets the share of trials that collided without need, rounded up."
)

_BRIGHT: Final = 50.0
"""Share from which the colour map is so bright that black is read better than white."""


def share_map(groups: Mapping[str, Sequence[tuple[int, Result]]], systems: Sequence[str]) -> Figure:
    """Draw a cell for every group of conditions and every system.

    Args:
        groups: conditions by the name of their row, each with its training seed.
        systems: names of the columns.

    Returns:
        The figure; a cell in whose trials nothing was possible is empty.
    """
    figure = Figure(
        figsize=(1.05 * len(systems) + 3.6, 0.3 * len(groups) + 1.6), layout="constrained"
    )
    axes = figure.subplots()
    mean = np.full((len(groups), len(systems)), np.nan)
    for row, column in np.ndindex(mean.shape):
        shares, needless = shares_by_seed(list(groups.values())[row], systems[column])
        if not shares:
            continue
        share = mean[row, column] = _per_cent(shares)
        collided = f" ({ceil(_per_cent(needless))})" if needless else ""
        colour = "black" if share > _BRIGHT else "white"
        axes.text(column, row, f"{floor(share)}{collided}", ha="center", va="center", color=colour)
    axes.imshow(mean, vmin=0.0, vmax=100.0, aspect="auto")
    axes.set_xticks(range(len(systems)), systems)
    axes.xaxis.tick_top()
    axes.set_yticks(range(len(groups)), list(groups))
    axes.tick_params(length=0.0)
    return figure


def _per_cent(shares: Sequence[float]) -> float:
    """Return the mean in per cent, without the dust of binary fractions: 0.29 is 29."""
    return round(100 * float(np.mean(shares)), 6)
