"""Rows of CSV files: one a trial, what was done first and what came of it last."""

from collections.abc import Iterable, Iterator, Mapping

from macor_hil.runs.trials import Trial

Row = Mapping[str, str | int | float]
"""A row of a CSV file by its columns."""


def trial_rows(trials: Iterable[Trial], where: Row) -> Iterator[dict[str, str | int | float]]:
    """Yield a row for each trial of a system.

    Args:
        trials: in their order.
        where: columns that are the same in all rows, such as seed and system.
    """
    for number, trial in enumerate(trials):
        yield {
            **where,
            "trial": number,
            "commands": trial.length,
            "collided": int(trial.collided),
            "touched": int(trial.touched),
            "reinforcement": round(trial.total, 3),
        }
