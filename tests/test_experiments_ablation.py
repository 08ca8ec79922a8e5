"""Ablation of foresight: its changes, its trials, its table, its rows."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from macor_hil.arrays import Array
from macor_hil.experiments.drives.arena_files import Place
from macor_hil.experiments.drives.course import Course
from macor_hil.experiments.drives.training_drive import Drive
from macor_hil.experiments.suite.ablation import ABLATION, CHANGES, Changed, averaged
from macor_hil.experiments.sweep.runner import reproduce
from macor_hil.mind.experience import Moment, Resonance
from macor_hil.mind.eyes.floor_profile import azimuths
from macor_hil.mind.foresight.collisions import Curve
from macor_hil.mind.foresight.skill import Skill
from macor_hil.mind.settings import MindSettings

SKILL = Skill(
    np.array([[0.8, 0.3, 0.7], [0.8, -0.3, -0.7], [0.9, 0.0, 0.0]]),
    Curve(0.7, 0.05, 0.01),
    np.array([0.54, 0.54, 0.62]),
    0.0,
)

ROOM = np.maximum(np.abs(np.cos(azimuths(120))), np.abs(np.sin(azimuths(120)))) / 2.0
"""View from the middle of a square room of four heights."""


class Known:
    memory = "foresight"
    skill = SKILL


def now(floor: Array) -> Moment:
    return Moment(np.zeros(1), np.zeros(1), Resonance(0, resonant=True, match=1.0), 0, floor)


def test_nothing_changed_changes_nothing() -> None:
    plain = CHANGES["as it is, 42 commands ahead"](SKILL).plan(Known(), now(ROOM))
    assert Changed(SKILL).plan(None, now(ROOM)) == plain
    assert len(set(plain.evaluations)) > 1


@pytest.mark.parametrize("name", list(CHANGES)[1:])
def test_every_change_changes_what_commands_are_worth(name: str) -> None:
    # beside a wall that hides what is behind it
    floor = np.maximum(ROOM, np.where(np.abs(azimuths(120) - 0.6) < 0.2, 1.0, 0.0))
    plain = CHANGES["as it is, 42 commands ahead"](SKILL).plan(Known(), now(floor))
    changed = CHANGES[name](SKILL).plan(Known(), now(floor))
    assert changed.evaluations != plain.evaluations


def test_distances_are_averaged_over_30_degrees() -> None:
    floor = np.random.default_rng(1).uniform(0.1, 2.0, 120)
    found = averaged(floor)
    assert found == pytest.approx(np.repeat(floor.reshape(12, 10).mean(axis=1), 10))
    assert averaged(np.arange(50.0)).shape == (50,)


@pytest.mark.long
def test_what_each_change_costs_is_told(tmp_path: Path) -> None:
    tiny = replace(
        ABLATION,
        settings=replace(
            ABLATION.settings,
            drive=Drive("maze", tuning=10, random=330, brain=MindSettings(nodes=8)),
            homes=(Place("maze"),),
            course=Course(trials=1, commands=3),
        ),
    )
    page = reproduce([tiny], 1, 1, tmp_path, lambda *_: None)
    with (page.parent / "ablation.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["change"] for row in rows] == list(CHANGES)
    assert {row["possible"] for row in rows} == {"3"}
    text = (page.parent / "report.md").read_text()
    assert all(f"| {name} | " in text for name in CHANGES)
    assert (page.parent / "ablation-maze-as-it-is.png").exists()
