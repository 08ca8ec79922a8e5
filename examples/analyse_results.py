"""Results of a sweep in pandas: a notebook, cell by cell.

    macor-hil reproduce table1 --quick --seeds 2
    python examples/analyse_results.py

It reads the folder that RESULTS names, or runs/reproduction, and draws lengths.png there. Editors
that know cells (`# %%`) run it piece by piece.
"""

# %% [markdown]
# One row a trial: training seed, system, and what came of it.

# %%
import os
from pathlib import Path

from matplotlib.figure import Figure

from macor_hil.experiments.results.frame import load_results

FOLDER = Path(os.environ.get("RESULTS", "runs/reproduction"))
trials = load_results(FOLDER, "table1")
print(trials.head())

# %% [markdown]
# A training seed is one independent sample: its trials are averaged first, then the seeds.

# %%
by_seed = trials.groupby(["system", "seed"], sort=False)[["commands", "collided"]].mean()
summary = by_seed.groupby("system", sort=False).agg(["mean", "std"])
print(summary.round(2))

# %% [markdown]
# Every seed is a dot.

# %%
figure = Figure(figsize=(7.0, 4.0), layout="constrained")
axes = figure.subplots()
for system, seeds in by_seed.groupby("system", sort=False):
    axes.plot([str(system)] * len(seeds), seeds["commands"], "o", alpha=0.5)
axes.set_ylabel("commands in a trial, mean of a seed's trials")
axes.set_ylim(bottom=0.0)
figure.savefig(FOLDER / "lengths.png", dpi=110)
print(FOLDER / "lengths.png")
