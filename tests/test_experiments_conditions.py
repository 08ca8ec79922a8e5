"""Conditions of figures 3 and 4: their drives and arenas, what counts as avoidance, the table."""

import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from khepera_protocol.zenoh.payloads import Pose, Reset, Truth

from khepera_emulator.arenas.arena import load_arena
from macor_hil.commands import COMMANDS, FIRST_COMMAND
from macor_hil.experiments.drives.course import Course, System
from macor_hil.experiments.drives.halls import LONG_CORRIDOR, WIDE_HALL, Hall
from macor_hil.experiments.drives.path_drive import PathDrive
from macor_hil.experiments.drives.training_drive import PUT_DOWN, Drive, Recording, Recordings
from macor_hil.experiments.paper.avoidance import (
    Behaviour,
    avoids,
    behaviour,
    figure3_claim,
    figure4_claim,
)
from macor_hil.experiments.paper.both_clusterers import reactive_system, trained_art
from macor_hil.experiments.paper.conditions import (
    ALL_CONDITIONS,
    CONDITIONS,
    NEAR,
    Condition,
    StraightOn,
    heeded,
)
from macor_hil.experiments.paper.figure2 import FIGURE2
from macor_hil.experiments.paper.figure3 import FIGURE3
from macor_hil.experiments.paper.figure4 import FIGURE4
from macor_hil.experiments.report.elements import Element, Table, Text
from macor_hil.experiments.results.store import Result, Results
from macor_hil.experiments.sweep.runner import reproduce
from macor_hil.hardware.bench import PortBench
from macor_hil.mind.brain import Brain
from macor_hil.mind.clusterers.neural_gas import Breadth
from macor_hil.mind.experience import Moment
from macor_hil.mind.memories.transitions import Competence, SensorimotorMap
from macor_hil.mind.planners.planner import Plan
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.mind.settings import MindSettings
from macor_hil.runs.trials import Trial

pytestmark = pytest.mark.long

DRIVE = Drive(tuning=10, random=60, brain=MindSettings(nodes=8))
PATH = PathDrive(tuning=10, random=60, brain=MindSettings(nodes=8))
STRAIGHT, TURN = Reinforcement().straight, Reinforcement().turn


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Recordings:
    return Recordings(tmp_path_factory.mktemp("recordings"), DRIVE)


@pytest.mark.parametrize(("hall", "posts"), [(LONG_CORRIDOR, 0), (WIDE_HALL, 3)])
def test_a_hall_is_an_arena_longer_than_a_trial(tmp_path: Path, hall: Hall, posts: int) -> None:
    arena = load_arena(hall.file(tmp_path))
    assert len(arena.cylinder) == posts
    ends = [x for x, _ in arena.wall[0].points]
    farthest = max(x for x, _ in arena.free.points)
    assert max(ends) - farthest > 40 * 0.021


def resets(drive: Drive, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[int, Recording]:
    """Number of times that the robot is put down in a drive, and its recording."""
    asked = []
    reset = PortBench.reset

    def counted(bench: PortBench, where: Reset) -> Truth:
        asked.append(where)
        return reset(bench, where)

    monkeypatch.setattr(PortBench, "reset", counted)
    recording = Recordings(folder, drive)[1]
    monkeypatch.undo()
    return len(asked), recording


def test_a_path_is_driven_without_being_put_down(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    count, recording = resets(PATH, tmp_path, monkeypatch)
    assert recording.collided.any()
    assert recording.commands[0] == PUT_DOWN
    assert (recording.commands != PUT_DOWN).sum() == PATH.random
    assert count == 2  # where the tuning and where the path begin
    often, _ = resets(DRIVE, tmp_path, monkeypatch)
    assert often > 3


def test_a_path_is_kept_apart_from_other_drives(tmp_path: Path) -> None:
    assert Recordings(tmp_path, PATH).key != Recordings(tmp_path, DRIVE).key
    assert PathDrive().beginning is None


def test_transitions_are_learned_as_in_a_live_drive(recordings: Recordings) -> None:
    recording = recordings[1]
    art = trained_art(recording.inputs, 6, 0.8, 0.001)
    system = reactive_system(recording, art, 6, Competence(), NEAR)
    live = Brain(
        recording.brain.eyes, art, {"transitions": SensorimotorMap(6, len(COMMANDS))}, NEAR
    )
    live.relive(recording.seen(), situations=False)
    learned, wanted = (each.memories["transitions"].state() for each in (system.brain, live))
    assert all(np.array_equal(learned[name], wanted[name]) for name in wanted)
    assert len(wanted["z"]) > 3
    assert system.brain.memories["transitions"] is not live.memories["transitions"]


def of(length: float, collided: float, before_turn: float = 5.0) -> Behaviour:
    """A behaviour that five seeds agree on, but for a little."""
    little = np.linspace(-0.01, 0.01, 5)
    return Behaviour(
        tuple(length + little),
        tuple(np.clip(collided + little, 0, 1)),
        tuple(before_turn + little),
        (0.1,) * 5,
    )


ON = of(10, 1.0)


def test_behaviour_is_read_from_trials() -> None:
    here = (Pose(x=0.0, y=0.0, heading=0.0),)
    turned = Trial((STRAIGHT, STRAIGHT, TURN, 0.0), True, True, here)
    never = Trial((STRAIGHT, STRAIGHT), False, False, here)
    found = behaviour([[turned, never], [never, never]], TURN)
    assert found == Behaviour((3.0, 2.0), (0.5, 0.0), (2.0, 2.0), (1 / 6, 0.0))


def test_a_system_avoids_if_it_is_shown_to_and_straight_on_would_not_do() -> None:
    assert avoids(of(30, 0.3), ON)
    assert avoids(of(30, 0.3))
    assert not avoids(of(30, 0.5), ON)
    assert not avoids(of(30, 0.3), of(30, 0.3))
    unsure = replace(of(30, 0.3), collided=(0.0, 0.0, 0.0, 0.7, 0.8))
    assert not avoids(unsure, ON)


def test_the_claim_of_figure_3() -> None:
    assert figure3_claim(of(30, 0.2, 3), of(30, 0.2, 8), ON).holds
    late = figure3_claim(of(30, 0.2, 8), of(30, 0.2, 3), ON)
    assert not late.holds
    assert late.said == "both are shown to avoid, but no earlier turns of Fuzzy ART"
    one = figure3_claim(of(30, 0.2, 3), of(20, 0.9, 8), ON)
    assert (one.holds, one.said) == (False, "only Fuzzy ART is shown to avoid")


def test_the_claim_of_figure_4() -> None:
    assert figure4_claim(of(30, 0.2), of(20, 0.9), ON).holds
    assert figure4_claim(of(30, 0.2), of(30, 0.2), ON).said == "both are shown to avoid"
    gas = figure4_claim(of(20, 0.9), of(30, 0.2), ON)
    assert gas.said == "only the Neural Gas is shown to avoid"
    assert figure4_claim(of(20, 0.9), of(20, 0.9), ON).said == "neither is shown to avoid"
    shorter = figure4_claim(of(30, 0.2), of(31, 0.5), ON)
    assert not shorter.holds
    assert shorter.said == "only Fuzzy ART is shown to avoid, but not to drive longer"


TINY = replace(
    CONDITIONS,
    settings=replace(
        CONDITIONS.settings,
        drive=DRIVE,
        own=40,
        conditions=(
            Condition("as it is", nodes=6),
            Condition("hall, a path", WIDE_HALL, path=True, nodes=6),
            Condition("shuffled means", nodes=6, shuffled=True, means=True, reinforcement=NEAR),
        ),
        early=20,
        breadth=Breadth((0.3,), (0.05,), (2.0,), (0.1,)),
        gas_presentations=1,
        searched=2,
        course=Course(trials=2, commands=3, anywhere=True),
    ),
)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return reproduce([TINY], 1, 1, tmp_path_factory.mktemp("conditions"), lambda *_: None)


def test_every_condition_is_driven_with_both_clusterers(report: Path) -> None:
    with (report.parent / "conditions.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 * 2 * 2 * 2
    assert {row["condition"] for row in rows} == {c.name for c in TINY.settings.conditions}
    assert {row["arena"] for row in rows} == {"corridor", "wide hall"}
    assert {row["sensory_training"] for row in rows} == {"20", "all"}
    assert (report.parent / "conditions-trajectories.png").exists()
    text = (report.parent / "report.md").read_text()
    assert "| as it is | no: neither is shown to avoid | no: neither is shown to avoid |" in text


def test_a_system_heeds_what_it_would_have_turned_away_from(recordings: Recordings) -> None:
    recording = recordings[1]
    art = trained_art(recording.inputs, 6, 0.8, 0.001)
    system = reactive_system(recording, art, 6, Competence(), NEAR)
    hits = recording.collided & (recording.commands == FIRST_COMMAND)
    assert hits.any()
    assert heeded(System(system.brain, StraightOn()), recording) == 0.0
    assert heeded(System(system.brain, Turning()), recording) == 1.0
    without = replace(recording, collided=np.zeros_like(recording.collided))
    assert heeded(System(system.brain, Turning()), without) == 0.0


class Turning(StraightOn):
    """Always turns left."""

    def plan(self, _memory: object, _now: Moment) -> Plan:
        return Plan((None,) * len(COMMANDS), 0)


def test_conditions_differ_from_the_first_in_what_they_name() -> None:
    first, *others = ALL_CONDITIONS
    assert first == Condition("as figures 3 and 4")
    named = [replace(each, name=first.name) for each in others]
    assert first not in named
    assert len(set(named)) == len(named)


def driven(*trials: tuple[int, bool]) -> list[Result]:
    """Trials as they are kept: straight on, the last command a collision or not."""
    return [
        {
            "r": [STRAIGHT] * (length - hit) + [0.0] * hit,
            "collided": hit,
            "touched": hit,
            "path": [[0.0, 0.0, 0.0]] * (length + 1),
        }
        for length, hit in trials
    ]


def avoiding(*conditions: str) -> Results:
    """Results in which only Fuzzy ART avoids collisions, under some conditions."""
    bad, good = driven((8, True), (9, True)), driven((40, False), (40, False))
    results: Results = {}
    for seed in range(1, 6):
        cases = {
            each.name: {
                steps: {"Fuzzy ART": good if each.name in conditions else bad, "Neural Gas": bad}
                for steps in ("early", "full")
            }
            for each in ALL_CONDITIONS
        }
        places = ("corridor", "long corridor", "wide hall")
        heeded = {key: {"Fuzzy ART": 0.25, "Neural Gas": 0.5} for key in ("early", "full")}
        results[seed] = {
            "straight": dict.fromkeys(places, bad),
            "driven": cases,
            "heeded": dict.fromkeys(cases, heeded),
        }
    return results


def test_the_first_sentence_tells_under_which_conditions_the_claims_hold() -> None:
    def first(results: Results) -> str:
        element, *_ = CONDITIONS.tell(CONDITIONS.settings, results)
        assert isinstance(element, Text)
        return element.text

    none = first(avoiding())
    assert none == (
        f"Here the claim of figure 3 holds under none of {len(ALL_CONDITIONS)} conditions and the"
        f" claim of figure 4 holds under none of {len(ALL_CONDITIONS)} conditions."
    )
    path = ALL_CONDITIONS[1].name
    assert f"figure 4 holds under 1 of {len(ALL_CONDITIONS)} conditions ({path})." in first(
        avoiding(path)
    )


def test_the_table_has_a_row_for_each_condition() -> None:
    path = ALL_CONDITIONS[1].name
    tables = [e for e in CONDITIONS.tell(CONDITIONS.settings, avoiding(path)) if type(e) is Table]
    claims, early, full, heeded = tables
    assert len(claims.rows) == len(early.rows) == len(full.rows) == len(ALL_CONDITIONS)
    assert claims.rows[0] == ("as figures 3 and 4", *["no: neither is shown to avoid"] * 2)
    only = "only Fuzzy ART is shown to avoid"
    assert claims.rows[1] == (path, f"no: {only}", f"yes: {only}")
    assert heeded.rows[1] == (path, "25 %", "50 %", "25 %", "50 %")
    assert early.rows[1][4:] == ("31.50 (31.50 to 31.50)", "0.031")


def first_sentences(elements: list[Element]) -> Iterator[str]:
    for element in elements:
        if isinstance(element, Text):
            yield element.text


def test_figures_3_and_4_begin_with_whether_their_claims_hold() -> None:
    bad, good = driven((8, True)), driven((40, False))
    common = {"seconds_a_command": 1.0, "error": {"Fuzzy ART": 1.0, "Neural Gas": 1.0}}
    place = {"Fuzzy ART": good, "Neural Gas": bad}
    results = {seed: {**common, "start": place, "anywhere": place} for seed in range(1, 6)}
    three = next(first_sentences(list(FIGURE3.tell(FIGURE3.settings, results))))
    assert three.startswith("The claim of figure 3 does not hold here, that is, in the corridor")
    assert "only Fuzzy ART is shown to avoid; of the trials collide Fuzzy ART in 0 %" in three
    four = next(first_sentences(list(FIGURE4.tell(FIGURE4.settings, results))))
    assert four.startswith("The claim of figure 4 holds here, that is, in the corridor")


@pytest.mark.parametrize("gas", [0.5, 0.9])
def test_figure_2_begins_with_whether_its_claim_holds(gas: float) -> None:
    falling = [gas + 0.2, gas + 0.15, gas + 0.1, gas + 0.05, gas, gas, gas]
    result = {
        "situations": 30,
        "annealing": {"rate": [0.6, 0.05], "radius": [5.0, 0.1]},
        "errors": {
            "Fuzzy ART": {"mean": [0.7] * 7, "variance": [0.1] * 7},
            "Neural Gas": {"mean": falling, "variance": [0.05] * 7},
        },
    }
    results = dict.fromkeys(range(1, 6), result)
    said = next(first_sentences(list(FIGURE2.tell(FIGURE2.settings, results))))
    if gas < 0.7:
        assert said.startswith("The claim of figure 2 holds here, in the corridor, with 30 nodes")
    else:
        assert said.startswith("The claim of figure 2 does not hold here")
        assert said.endswith("; not shown: Fuzzy ART has the greater error.")
