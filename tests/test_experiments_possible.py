"""Trials beside what was possible from their starts."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from macor_hil.experiments.drives.course import Course, System, on_course, trial_as_json
from macor_hil.experiments.drives.training_drive import Drive, record
from macor_hil.experiments.experiment import Courses
from macor_hil.experiments.paper.conditions import CONDITIONS, StraightOn
from macor_hil.experiments.paper.table1 import TABLE1
from macor_hil.experiments.report.elements import Element, Table, Text
from macor_hil.experiments.results.store import Result, Results
from macor_hil.experiments.sweep.possible import compared, starts_of
from macor_hil.experiments.sweep.runner import report, reproduce
from macor_hil.runs.trials import Trial

HERE = Course(trials=3, commands=4)
ANYWHERE = Course(trials=3, commands=4, anywhere=True)
DRIVE = Drive(tuning=10, random=24)


UNTOLD = replace(
    TABLE1,
    settings=replace(TABLE1.settings, drive=DRIVE, course=HERE),
    draw=lambda *_: {},
    tell=lambda *_: [],
)
"""Table 1 without pictures and text of its own."""

OF_ANOTHER = replace(
    UNTOLD,
    courses=Courses(lambda *_: {HERE.place: HERE}, lambda _, result: result["trials"]),
)
"""The same of results that have their trials by course."""


def told(results: Results, found: Results, out: Path) -> list[Element]:
    starts = starts_of(OF_ANOTHER, out)
    assert starts is not None
    return compared(OF_ANOTHER, results, starts, found)


@pytest.mark.parametrize("course", [HERE, ANYWHERE], ids=lambda course: str(course.place))
def test_starts_are_where_trials_start(course: Course) -> None:
    brain = record(DRIVE, 1).brain
    with on_course(course, 1, DRIVE) as track:
        system = System(brain, StraightOn())
        assert track.starts(1) == [trial.path[0] for trial in track.drive(system, 1)]
        assert [one.length for one in track.possible(1)] == [4, 4, 4]


def result(*lengths: int) -> Result:
    trials = [trial_as_json(Trial((0.6,) * n, n < 4, False, ())) for n in lengths]
    return {"trials": {"corridor": {"graded": trials}}}


def test_trials_are_compared_with_what_was_possible(tmp_path: Path) -> None:
    starts = {seed: {"corridor": [[4, True], [2, True], [0, True]]} for seed in (1, 2)}
    results = {1: result(4, 3, 1), 2: result(3, 3, 1)}
    table, text = told(results, starts, tmp_path)
    assert isinstance(table, Table)
    assert isinstance(text, Text)
    # of the first seed all that was possible was driven, of the second (2/4 + 2/2) / 2
    assert table.rows == (("corridor: graded", "87.5 % (75.0 to 100.0); 50 % (0 to 100)"),)
    assert text.text.endswith(
        " corridor, 4 commands: From 2 of 6 starts nothing is possible: they count in no share."
        " From 2 a collision is inevitable later on."
    )


def test_nothing_is_told_where_a_seed_s_starts_are_missing(tmp_path: Path) -> None:
    starts = {1: {"corridor": [[4, True]]}}
    assert told({1: result(4), 2: result(4)}, starts, tmp_path) == []
    assert starts_of(replace(TABLE1, courses=None), tmp_path) is None


def test_a_sweep_keeps_starts_beside_its_trials_and_tells_of_them(tmp_path: Path) -> None:
    said: list[str] = []
    page = reproduce([UNTOLD], 1, 1, tmp_path, lambda what, *_: said.append(what))
    assert list(dict.fromkeys(said)) == [
        "driving for table1",
        "table1",
        "starts of table1",
        "report",
    ]
    (kept,) = (tmp_path / "results").glob("starts-*.jsonl")
    found = json.loads(kept.read_text().splitlines()[1])["result"]
    assert found == {"corridor": [[4, True]] * 3}
    text = page.with_name("report.md").read_text()
    assert "| corridor: graded | " in text
    assert "| corridor: reactive, collision at -1 | " in text
    assert "corridor, 4 commands: From every start all commands are possible." in text
    kept.unlink()
    report([UNTOLD], 1, tmp_path, lambda *_: None)
    assert "what was possible" not in page.with_name("report.md").read_text()
    shutil.rmtree(tmp_path / "recordings")
    reproduce([UNTOLD], 1, 1, tmp_path, lambda *_: None)  # starts need no drive
    assert not (tmp_path / "recordings").exists()


def test_conditions_have_a_course_in_each_arena(tmp_path: Path) -> None:
    starts = starts_of(CONDITIONS, tmp_path)
    assert starts is not None
    courses = starts.settings.courses
    assert list(courses) == ["corridor", "long corridor", "wide hall"]
    assert all(course.anywhere for course in courses.values())
    assert Path(courses["wide hall"].arena).exists()
