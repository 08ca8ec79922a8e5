"""The suite of arenas: its files, its trials, its table, its rows."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from as_type import as_type
from made_once import made_once

from khepera_emulator.arenas.arena import load_arena
from macor_hil.experiments.drives.arena_files import Place, bundled_arenas
from macor_hil.experiments.drives.course import Course
from macor_hil.experiments.drives.systems import learn_foresight, learn_situations
from macor_hil.experiments.drives.training_drive import Drive, Recordings
from macor_hil.experiments.results.store import Result
from macor_hil.experiments.suite.amounts import AMOUNTS
from macor_hil.experiments.suite.arenas import (
    ARENAS,
    ELSEWHERE,
    IN_PLACE,
    SYSTEMS,
    Settings,
    lights_of,
)
from macor_hil.experiments.suite.share_map import share_map
from macor_hil.experiments.suite.shares import cell
from macor_hil.experiments.sweep.runner import reproduce
from macor_hil.mind.memories.foresight import ForesightMemory
from macor_hil.mind.memories.graded import GradedMemory
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.settings import MindSettings

pytestmark = pytest.mark.long

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
    out = made_once(
        tmp_path_factory, "arenas", lambda out: reproduce([TINY], 1, 1, out, lambda *_: None)
    )
    return out / "report" / "index.html"


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
        "arenas-shares-in-place.png",
        "arenas-shares-other-light.png",
        "arenas-shares-on-a-mixture.png",
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


def test_other_light_falls_on_arenas_as_they_come() -> None:
    settings = ARENAS.settings
    lit = [place for place in settings.homes if len(lights_of(settings, place)) > 1]
    assert [place.arena for place in lit] == list(bundled_arenas())
    assert not any(place.own_colours for place in lit)
    assert lights_of(settings, Place("maze")) == ("as trained", *settings.lights)


def test_all_drives_of_the_suite_are_made_before_its_trials(tmp_path: Path) -> None:
    said: list[tuple[str, int, int]] = []

    def stop(*step: Any) -> None:
        said.append(step)
        if step[0] == "arenas":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce([TINY], 1, 2, tmp_path, stop)
    driven = [("driving for arenas", done, 2) for done in range(3)]
    # the home, and the mixture
    assert said == [*driven, ("arenas", 0, 2)]
    assert len(list((tmp_path / "recordings").glob("*/seed-0001.frames.npz"))) == 2


def condition(driven: int, collided: bool) -> Result:
    """A condition of one trial, of 10 commands that were all possible."""
    trial = {
        "r": [0.5] * driven,
        "collided": collided,
        "touched": collided,
        "path": [[0, 0, 0]] * (driven + 1),
    }
    return {"commands": 10, "possible": [[10, True]], "trials": {"graded": [trial]}}


def test_a_cell_has_intervals_where_there_are_several_seeds() -> None:
    whole, half = condition(10, collided=False), condition(6, collided=True)
    assert cell([(1, half)], "graded") == "50.0 %; 100 %"
    # of the same seed: the mean of its trials, and no interval
    assert cell([(1, whole), (1, half)], "graded") == "75.0 %; 50 %"
    several = cell([(1, whole), (2, half)], "graded")
    assert several == "75.0 % (50.0 to 100.0); 50 % (0 to 100)"


def test_the_map_of_shares_flatters_nobody() -> None:
    whole, nearly = condition(10, collided=False), condition(9, collided=True)
    walled_in = condition(1, collided=True) | {"possible": [[0, True]]}
    some = condition(29, collided=False) | {"possible": [[100, True]]}
    many = [(seed, whole) for seed in range(1, 250)]
    figure = share_map(
        {
            "free": many,
            "nearly": [*many, (250, nearly)],
            "none": [(1, walled_in)],
            "some": [(1, some)],
        },
        ["graded"],
    )
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.texts] == ["100 (0)", "99 (1)", "29 (0)"]
    assert [tick.get_text() for tick in axes.get_yticklabels()] == [
        "free",
        "nearly",
        "none",
        "some",
    ]


AMOUNTS_TINY = replace(
    AMOUNTS,
    settings=replace(
        AMOUNTS.settings,
        drive=Drive("maze", tuning=10, random=130, brain=MindSettings(nodes=8)),
        homes=(Place("maze"),),
        situations=(4, 8),
        commands=(125, 130),
        course=Course(trials=1, commands=4),
    ),
)


def test_success_is_told_against_situations_and_commands(tmp_path: Path) -> None:
    page = reproduce([AMOUNTS_TINY], 1, 1, tmp_path, lambda *_: None)
    with (page.parent / "amounts.csv").open() as file:
        rows = list(csv.DictReader(file))
    amounts = [(row["system"], row["unit"], row["amount"]) for row in rows]
    assert amounts == [
        *((name, "situations", n) for name in ("expected", "graded") for n in ("4", "8")),
        *(("foresight", "training commands", n) for n in ("125", "130")),
    ]
    text = (page.parent / "report.md").read_text()
    for name, unit, amount in amounts:
        assert f"| {name}, {amount} {unit} | " in text
    assert (page.parent / "amounts-shares.png").exists()


def test_more_situations_are_learned_where_they_are_asked_for(tmp_path: Path) -> None:
    settings = AMOUNTS_TINY.settings
    recording = Recordings(tmp_path, settings.drive)[1]
    for nodes in (4, 8):
        learned = learn_situations(
            replace(settings, nodes=nodes), recording, np.random.default_rng(1)
        )
        brain = learned["graded"].brain
        assert as_type(GradedMemory, brain.memories["graded"]).counts.tried.shape == (nodes, 3)
        assert as_type(SensorimotorMap, brain.memories["transitions"]).nodes == nodes
    # foresight learns from the beginning alone
    early, late = (learn_foresight(settings, recording.first(n)) for n in (100, 130))
    frames = [
        len(as_type(ForesightMemory, system.brain.memories["foresight"]).state()["commands"])
        for system in (early, late)
    ]
    assert 100 < frames[0] <= frames[1] - 30
