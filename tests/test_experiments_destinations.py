"""Going somewhere: trials against the shortest way, tables, rows, pictures."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest
from made_once import made_once

from macor_hil.experiments import catalogue
from macor_hil.experiments.destinations import DESTINATIONS, MAZE, OPEN, Settings, Target
from macor_hil.experiments.drives.training_drive import Drive
from macor_hil.experiments.sweep import changes
from macor_hil.experiments.sweep.runner import reproduce
from macor_hil.mind.settings import MindSettings

pytestmark = pytest.mark.long

BOX = Target("open-box", "red", (0.85, 0.2, 0.2), 0.12)

TINY = replace(
    DESTINATIONS,
    settings=Settings(
        nodes=8,
        drive=Drive("open-box", tuning=15, random=1_500, brain=MindSettings(nodes=8)),
        targets=(BOX, OPEN),
        starts=2,
        compared=1,
        looks=(0, 100),
    ),
)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = made_once(
        tmp_path_factory, "destinations", lambda out: reproduce([TINY], 1, 1, out, lambda *_: None)
    )
    return out / "report" / "index.html"


def test_every_trial_has_a_row_and_the_goal_is_reached(report: Path) -> None:
    with (report.parent / "destinations.csv").open() as file:
        rows = list(csv.DictReader(file))
    own = [row for row in rows if (row["system"], row["goal"]) == ("goal", "red")]
    assert len(own) == 2
    for row in own:
        assert (row["reached"], row["collided"]) == ("1", "0")
        assert int(row["shortest"]) <= int(row["way"]) + 1
        # so few commands know little of a square metre
        assert int(row["way"]) <= 2 * int(row["shortest"]) + 10
    others = {(row["system"], row["relearned"]) for row in rows if row["system"] != "goal"}
    assert others == {
        ("foresight", "0"),
        *((name, frames) for name in ("q-learning", "graded") for frames in ("0", "100")),
    }


def test_a_goal_that_is_kept_to_is_reached_on_the_way(report: Path) -> None:
    with (report.parent / "destinations.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["goal"] == "along:red"]
    own = [row for row in rows if row["system"] == "goal"]
    assert len(own) == 2
    for row in own:
        assert (row["reached"], row["collided"]) == ("1", "0")
        # there is room to go on, so it does not end where it comes to the wall
        assert int(row["way"]) < int(row["commands"]) == int(row["asked"])
        assert float(row["kept"]) > 0.3
    assert "driven of what was possible" in report.read_text("utf-8")


def test_the_report_tells_what_was_reached(report: Path) -> None:
    text = report.read_text("utf-8")
    assert "open-box, red" in text
    assert "nothing relearned" in text
    assert list(report.parent.rglob("destinations-open-box-red.*"))


def test_it_has_a_quick_form_of_the_maze_alone() -> None:
    (quick,) = changes.quick(catalogue.find("destinations"))
    assert quick.settings.targets == (MAZE,)
