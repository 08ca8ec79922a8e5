"""Results as rows of CSV files and as data frames."""

import csv
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from made_once import made_once

from macor_hil.errors import MacorError
from macor_hil.experiments.beyond import BEYOND, CHANGES
from macor_hil.experiments.drift import DRIFT
from macor_hil.experiments.drives.course import Course
from macor_hil.experiments.drives.systems import SYSTEMS
from macor_hil.experiments.drives.training_drive import Drive
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.goals import GOALS, SHOWN
from macor_hil.experiments.paper.figure3 import FIGURE3
from macor_hil.experiments.paper.table1 import TABLE1, VARIED
from macor_hil.experiments.results.frame import load_results
from macor_hil.experiments.sweep.runner import reproduce
from macor_hil.mind.clusterers.neural_gas import Breadth
from macor_hil.mind.settings import MindSettings

pytestmark = pytest.mark.long

DRIVE = Drive(tuning=10, random=24, brain=MindSettings(nodes=8))
COURSE = Course(trials=2, commands=2)
EXAMPLE = Path(__file__).parent.parent / "examples" / "analyse_results.py"


def tiny(experiment: Experiment, **changes: object) -> Experiment:
    settings = replace(experiment.settings, drive=DRIVE, nodes=8, **changes)
    return replace(
        experiment, settings=settings, draw=lambda *_: {}, tell=lambda *_: (), most_seeds=None
    )


TINY: Sequence[Experiment] = (
    tiny(TABLE1, course=COURSE),
    tiny(
        FIGURE3,
        course=COURSE,
        elsewhere=replace(COURSE, anywhere=True),
        gas_inputs=20,
        breadth=Breadth((0.3,), (0.05,), (2.0,), (0.1,)),
    ),
    tiny(BEYOND, courses=(COURSE, replace(COURSE, arena="corridor-mirror"))),
    tiny(GOALS, course=COURSE, looks=(0, 10)),
    tiny(DRIFT, course=COURSE, trained=("default",), driven=("none", "strong")),
)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All of them, of two seeds."""
    return made_once(
        tmp_path_factory, "frames", lambda out: reproduce(TINY, 2, 1, out, lambda *_: None)
    )


def rows_of(sweep: Path, name: str) -> list[dict[str, str]]:
    with (sweep / "report" / f"{name}.csv").open() as file:
        return list(csv.DictReader(file))


ROWS = {  # of each seed
    "table1": (len(SYSTEMS) + len(VARIED)) * 2,
    "figure3": 2 * 2 * 2,
    "beyond": len(CHANGES) * 2 * 2,
    "goals": len(SHOWN) * 3,
    "drift": 2 * 2 * 2,
}
WHERE = {
    "table1": [],
    "figure3": ["starts"],
    "beyond": ["place"],
    "goals": ["frames"],
    "drift": ["trained", "driven"],
}


@pytest.mark.parametrize("name", ROWS)
def test_every_trial_is_a_row(sweep: Path, name: str) -> None:
    rows = rows_of(sweep, name)
    assert len(rows) == 2 * ROWS[name]
    keys = [*WHERE[name], "seed", "system", *(["trial"] if name != "goals" else [])]
    assert list(rows[0])[: len(keys)] == keys
    assert len({tuple(row[key] for key in keys) for row in rows}) == len(rows)
    assert {row["seed"] for row in rows} == {"1", "2"}
    for row in rows:
        if name != "goals":
            assert int(row["commands"]) in (1, 2)
            assert (row["collided"], row["touched"]) <= ("1", "1")
        least = -1.0 if "collision at -1" in row["system"] else 0.0
        assert least <= float(row["reinforcement"]) < 2.0


def test_results_are_a_frame(sweep: Path) -> None:
    pytest.importorskip("pandas")
    frame = load_results(sweep, "table1")
    assert len(frame) == len(rows_of(sweep, "table1"))
    assert frame["collided"].dtype == bool
    assert frame["commands"].dtype == "int64"
    assert list(frame["system"].unique())[: len(SYSTEMS)] == list(SYSTEMS)
    one = frame[(frame["system"] == "graded") & (frame["seed"] == 2)]
    assert one["trial"].tolist() == [0, 1]


def test_results_that_are_not_there_are_told(sweep: Path, tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    with pytest.raises(MacorError, match="there are: beyond, drift, figure3, goals, table1"):
        load_results(sweep, "arenas")
    with pytest.raises(MacorError, match=f"reproduce table1 --out {tmp_path}"):
        load_results(tmp_path, "table1")
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "table1.csv").write_bytes(b"")
    with pytest.raises(MacorError, match=r"cannot read .*table1.csv"):
        load_results(tmp_path, "table1")


def test_the_extra_is_named_where_pandas_is_missing(
    sweep: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MacorError, match="install the extra 'analysis' with: "):
        load_results(sweep, "table1")


def test_the_notebook_runs(sweep: Path) -> None:
    pytest.importorskip("pandas")
    done = subprocess.run(
        [sys.executable, EXAMPLE],
        env={**os.environ, "RESULTS": str(sweep)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for system in SYSTEMS:
        assert system in done.stdout
    assert (sweep / "lengths.png").stat().st_size > 5_000
