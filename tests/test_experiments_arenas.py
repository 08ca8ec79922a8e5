"""The suite of arenas: its files, its trials, its table, its rows."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest
from typer.testing import CliRunner

from khepera_emulator.arenas.arena import load_arena
from macor_hil.cli import app
from macor_hil.errors import MacorError
from macor_hil.experiments import catalogue
from macor_hil.experiments.arenas import ARENAS, ELSEWHERE, IN_PLACE, SYSTEMS, Settings
from macor_hil.experiments.drives.arena_files import Place, bundled_arenas
from macor_hil.experiments.drives.course import Course
from macor_hil.experiments.drives.training_drive import Drive
from macor_hil.experiments.sweep.runner import reproduce
from macor_hil.mind.settings import MindSettings

TINY = replace(
    ARENAS,
    settings=Settings(
        nodes=8,
        drive=Drive("maze", tuning=10, random=130, brain=MindSettings(nodes=8)),
        homes=(Place("maze"),),
        mixture=(100,),
        unseen=(1,),
        lights=("dim",),
        course=Course(trials=1, commands=6),
    ),
)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("suite")
    return reproduce([TINY], 1, 1, out, lambda *_: None)


def test_every_trial_has_a_row(report: Path) -> None:
    with (report.parent / "arenas.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 * len(SYSTEMS)
    where = {(row["trained"], row["arena"], row["look"], row["light"]) for row in rows}
    assert where == {
        (IN_PLACE, "maze", "as it is", "as trained"),
        (IN_PLACE, "maze", "as it is", "dim"),
        (ELSEWHERE, "generated-1", "as it is", "as trained"),
    }
    for row in rows:
        driven = int(row["commands"]) - int(row["collided"])
        assert int(row["possible"]) == 6
        assert float(row["share"]) == pytest.approx(driven / 6, abs=1e-4)
    assert {row["system"] for row in rows} == set(SYSTEMS)
    assert any(row["share"] != "1.0" for row in rows)


def test_the_report_tells_and_shows_every_arena(report: Path) -> None:
    text = (report.parent / "report.md").read_text()
    assert "| maze, as it is | " in text
    assert "Trained in place, foresight is asked for at least 99 %" in text
    pictures = {path.name for path in report.parent.glob("arenas-*.png")}
    assert pictures == {
        "arenas-in-place-maze-as-it-is.png",
        "arenas-on-a-mixture-generated-1-as-it-is.png",
    }


def test_arenas_are_names_or_files(tmp_path: Path) -> None:
    assert Place("maze").file(tmp_path) == "maze"
    path = Place("maze", own_colours=True).file(tmp_path)
    colours = [wall.colour for wall in load_arena(path).wall]
    assert len(set(colours)) == len(colours) > 10
    assert load_arena(Place(3).file(tmp_path)).title.startswith("Generated from seed 3")


def test_the_suite_has_every_bundled_arena() -> None:
    homes = ARENAS.settings.homes
    assert {place.arena for place in homes if place.own_colours} == set(bundled_arenas())
    assert {place.arena for place in homes if not place.own_colours} > set(bundled_arenas())
    assert not set(ARENAS.settings.mixture) & set(ARENAS.settings.unseen)


def test_the_quick_form_is_of_those_that_have_one() -> None:
    (quick,) = catalogue.quick(catalogue.find("arenas"))
    assert quick.settings == ARENAS.quick
    assert quick.settings.drive.random < Drive().random
    with pytest.raises(MacorError, match="no quick form; these have: conditions, arenas"):
        catalogue.quick(catalogue.find("table1"))
    said = CliRunner().invoke(cast(Any, app), ["reproduce", "table1", "--quick"])
    assert said.exit_code != 0
