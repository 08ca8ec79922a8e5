"""Results of a sweep as a data frame: one row a trial, for pandas and what builds on it.

from macor_hil.experiments.results.frame import load_results

trials = load_results("runs/reproduction", "table1")
trials.groupby("system")["commands"].mean()
"""

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Final

from khepera_protocol.extras import how_to_install
from khepera_protocol.text import quoted

from macor_hil.errors import MacorError
from macor_hil.files import MIB, InputError, read_bounded

if TYPE_CHECKING:
    import pandas

_MOST_BYTES: Final = 256 * MIB
_YES_OR_NO: Final = ("collided", "touched", "certain")


def load_results(folder: Path | str, experiment: str) -> "pandas.DataFrame":
    """Return the rows of an experiment, as the last sweep wrote them beside its report.

    Columns that all experiments with trials have: `seed` of the training, `system`, `trial` (its
    number), `commands` that were driven (the one that collided included), `collided`, `touched`
    and `reinforcement` (of all commands together). Others say where it was driven; the suite has
    `possible` (commands, by a search over the floor plan), `certain` (whether there are no more)
    and `share`, of the possible commands.

    Args:
        folder: that of `macor-hil reproduce --out`.
        experiment: its name, such as table1.

    Raises:
        MacorError: pandas is not installed, or there are no such results.
    """
    try:
        import pandas
    except ImportError:
        raise MacorError(
            "pandas is not installed; install the extra 'analysis' with:"
            f" {how_to_install('analysis')}"
        ) from None
    report = Path(folder) / "report"
    path = report / f"{experiment}.csv"
    try:
        frame = pandas.read_csv(BytesIO(read_bounded(path, _MOST_BYTES)))
    except FileNotFoundError:
        there = ", ".join(sorted(file.stem for file in report.glob("*.csv"))) or "none"
        raise MacorError(
            f"there are no results of {quoted(experiment, 80)} in {report} (there are: {there});"
            f" make them with: macor-hil reproduce {experiment} --out {folder}"
        ) from None
    except (OSError, InputError, ValueError) as error:  # pandas' own errors are ValueErrors
        raise MacorError(f"cannot read {path}: {error}") from None
    return frame.astype({name: bool for name in _YES_OR_NO if name in frame})
