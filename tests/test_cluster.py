"""Sweeps on a dask cluster: real scheduler, two real workers, the same bytes."""

from dataclasses import replace
from pathlib import Path

import pytest

from macor_hil.errors import MacorError
from macor_hil.experiments.drives.course import Course
from macor_hil.experiments.drives.training_drive import Drive
from macor_hil.experiments.paper.table1 import TABLE1
from macor_hil.experiments.sweep.runner import reproduce
from macor_hil.mind.settings import MindSettings

pytestmark = pytest.mark.long

distributed = pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")

DRIVE = Drive(tuning=10, random=24, reactive=6, brain=MindSettings(nodes=8))
COURSE = Course(trials=2, commands=2)
TINY = replace(
    TABLE1,
    settings=replace(TABLE1.settings, drive=DRIVE, nodes=8, course=COURSE),
    draw=lambda *_: {},
    tell=lambda *_: [],
)


def results_of(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (out / "results").glob("*.jsonl")}


def silent(*_: object) -> None:
    """Nobody watches."""


def test_workers_of_a_cluster_give_the_same_bytes(tmp_path: Path) -> None:
    reproduce([TINY], 3, 1, tmp_path / "here", silent)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
    ) as cluster:
        reproduce([TINY], 3, 1, tmp_path / "there", silent, cluster.scheduler_address)
    assert len(results_of(tmp_path / "here")) == 2  # of the table, and what was possible
    assert results_of(tmp_path / "there") == results_of(tmp_path / "here")


def test_a_cluster_that_is_not_there_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("macor_hil.experiments.sweep.engine._PATIENCE", "300ms")
    with pytest.raises(MacorError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:9"):
        reproduce([TINY], 1, 1, tmp_path, silent, "tcp://127.0.0.1:9")
