"""Table 1 and figure 5 on made-up trials: what is told of the paper's claims."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import radians

import pytest

from khepera_emulator.robot.epuck.models import EPUCK2
from macor_hil.experiments.drives.course import on_course, trial_as_json, trial_from_json
from macor_hil.experiments.drives.systems import ANTICIPATIVE, REACTIVE, SYSTEMS, Q
from macor_hil.experiments.paper import figure5
from macor_hil.experiments.paper.criteria import PAPER
from macor_hil.experiments.paper.figure5 import BEGUN, FIGURE5, ROUND, STRAIGHT, usual_way, way_of
from macor_hil.experiments.paper.placing import likeness, percentile, placing_table
from macor_hil.experiments.paper.table1 import TABLE1, Settings, under_variant
from macor_hil.experiments.report.elements import Table, Text
from macor_hil.experiments.results.store import Result, Results
from macor_hil.experiments.sweep.changes import with_settings
from macor_hil.hardware.robots.epuck.client import Epuck
from macor_hil.runs.trials import Trial

SEEDS = range(1, 7)


def made(length: int, collided: bool, *, turned: float = 0.0, r: float = 0.6) -> Trial:
    """A trial that turns to the left by so many degrees in its last command."""
    path = [[0.0, 0.0, 0.0]] * length + [[0.0, 0.0, radians(turned)]]
    earned = [r] * length
    if collided:
        earned[-1] = 0.0
    return trial_from_json({"r": earned, "collided": collided, "touched": False, "path": path})


def result_of(trials: Mapping[str, Sequence[Trial]]) -> Result:
    kept = {name: [trial_as_json(one) for one in trials[name]] for name in trials}
    variant = {name: kept[name] for name in PAPER}
    return {"robot_hours": 3.0, "trials": kept, "variant": variant}


def results_of(lengths: Mapping[str, int]) -> Results:
    """Six trainings with trials of a length each, which grows a little with the seed."""
    usual = {**dict.fromkeys(SYSTEMS, 8), **lengths}
    return {
        seed: result_of({name: [made(usual[name] + seed, True)] * 2 for name in usual})
        for seed in SEEDS
    }


def first_sentence(results: Results, settings: Settings = TABLE1.settings) -> str:
    first = TABLE1.tell(settings, results)[0]
    assert isinstance(first, Text)
    return first.text.partition(". ")[0]


def test_a_percentile_counts_equal_ones_half() -> None:
    assert percentile(29.2, [8.0, 10.0, 29.24, 40.0]) == 62.5
    assert percentile(7.2, [8.0, 8.1]) == 0.0
    assert percentile(0.3, [0.1 + 0.2, 0.25]) == 75.0  # 0.25 is printed as 0.2
    with pytest.raises(ValueError, match="no values"):
        percentile(1.0, [])


def test_ten_trials_that_are_the_row_look_like_it() -> None:
    printed = PAPER[REACTIVE]
    alike, longer = ([made(length, True)] * 10 for length in (7, 8))
    sure = likeness(printed, [alike])
    assert (sure.collisions.value, sure.length.value, sure.both.value) == (1.0, 1.0, 1.0)
    # a command longer is more than two standard errors, 0.25, away
    half = likeness(printed, [alike, longer, longer, alike])
    assert (half.collisions.value, half.length.value, half.both.value) == (1.0, 0.5, 0.5)
    assert (half.both.low, half.both.high) == (0.0, 1.0)


def test_a_training_of_both_kinds_of_trials_looks_like_the_row_by_chance() -> None:
    # 40 % collide after 13 commands: four of ten with a probability of 0.251, and then the mean
    # length is 29.2; it lies within 9.0 of that with one to seven collisions, 0.982
    printed = PAPER[ANTICIPATIVE]
    mixed = [made(13, True)] * 4 + [made(40, False)] * 6
    found = likeness(printed, [mixed] * 3)
    assert found.collisions.value == pytest.approx(0.251, abs=0.02)
    assert found.both.value == found.collisions.value
    assert found.length.value == pytest.approx(0.982, abs=0.01)
    assert likeness(printed, [mixed] * 3) == found


def test_every_printed_row_has_its_place() -> None:
    results = results_of({ANTICIPATIVE: 26, Q: 9})
    table = placing_table([("here", results)])
    assert [row[0] for row in table.rows] == [f"{name}, here" for name in PAPER]
    # trials of 27 to 32 commands: 29.2 is longer than three of six
    assert table.rows[1][3:5] == ("29.2", "50")
    assert table.rows[0][4] == "0"


def test_another_model_is_trained_and_tried() -> None:
    (table,) = with_settings([TABLE1], ["drive.model=epuck2", "drive.baud=115200"])
    settings = table.settings
    with settings.drive.robot(1) as hardware:
        assert isinstance(hardware.robot, Epuck)
        assert hardware.robot.port.baudrate == 115_200
    with on_course(settings.course, 1, settings.drive) as track:
        assert track.outline().robot_radius == EPUCK2.radius
    assert " commands of robots of the model epuck2 in the arena " in first_sentence(
        results_of({ANTICIPATIVE: 20, Q: 12}), settings
    )


def test_the_first_sentence_tells_whether_the_claim_holds() -> None:
    said = first_sentence(results_of({ANTICIPATIVE: 20, Q: 12}))
    assert said == (
        "The table's claim, anticipative over q-learning over reactive, holds in length and"
        " reinforcement with a collision at 0 and at -1 alike, in 6 trainings of 13,000 commands in"
        " the arena corridor, with 50 nodes and vigilance 0.9"
    )


def test_the_first_sentence_names_what_is_not_shown() -> None:
    results = results_of({ANTICIPATIVE: 20, Q: 12})
    for result in results.values():  # longer drives of turns that earn little
        poor = [trial_as_json(made(14, True, r=0.1))]
        result["trials"] = {**result["trials"], Q: poor}
        result["variant"] = {**result["variant"], Q: poor, ANTICIPATIVE: poor}
    said = first_sentence(results)
    assert (
        "holds in length but is not shown in reinforcement (missing: q-learning over reactive) with"
        " a collision at 0 and is shown neither in length (missing: anticipative over q-learning)"
        " nor in reinforcement (missing: anticipative over q-learning; q-learning over reactive) at"
        " -1, in 6"
    ) in said
    few = TABLE1.tell(TABLE1.settings, {1: results[1]})[0]
    assert isinstance(few, Text)
    assert "With 1 seeds p < 0.05 cannot be reached whatever happens." in few.text


def test_the_variant_is_told_in_the_paper_s_form() -> None:
    results = results_of({})
    for result in results.values():
        result["variant"] = {name: [trial_as_json(made(7, True))] for name in PAPER}
    assert list(under_variant(results)[1]["trials"]) == list(PAPER)
    tables = [each for each in TABLE1.tell(TABLE1.settings, results) if isinstance(each, Table)]
    (variant,) = (each for each in tables if each.title.endswith("form, collision at -1"))
    assert [row[0] for row in variant.rows[:2]] == ["reactive, here", "reactive, paper"]
    assert variant.rows[0][3] == "7.0"
    assert len(variant.rows) == 6


def test_a_way_is_round_the_curve_or_ends_before_or_after_its_half() -> None:
    assert way_of(made(40, False, turned=90.0)) == ROUND
    assert way_of(made(12, True, turned=60.0)) == BEGUN
    assert way_of(made(8, True, turned=30.0)) == STRAIGHT
    # to the right is no part of the curve
    assert way_of(made(8, True, turned=-90.0)) == STRAIGHT
    assert usual_way([made(40, False), made(40, False), made(8, True)]) == ROUND
    assert usual_way([made(40, False), made(8, True)]) is None


def ways(**turned: float | None) -> Result:
    trials = {
        name: [made(40, False) if turned[key] is None else made(9, True, turned=turned[key] or 0.0)]
        for name, key in ((REACTIVE, "reactive"), (ANTICIPATIVE, "anticipative"), (Q, "q"))
    }
    return result_of(trials)


def test_figure_5_tells_in_how_many_trainings_its_claim_holds() -> None:
    as_printed = ways(reactive=0.0, anticipative=None, q=60.0)
    stuck = ways(reactive=0.0, anticipative=0.0, q=60.0)

    def said(*results: Result) -> str:
        return figure5._claim(FIGURE5.settings, dict(enumerate(results, 1)))

    assert "collides within it, holds here in 1 of 3 trainings" in said(as_printed, stuck, stuck)
    assert "reactive in 3, anticipative in 1, q-learning in 3." in said(as_printed, stuck, stuck)
    assert "holds here in all 2 trainings" in said(as_printed, as_printed)
    assert "holds here in none of 1 trainings" in said(stuck)
    drive = replace(FIGURE5.settings.drive, random=100)
    settings = replace(FIGURE5.settings, drive=drive, nodes=30)
    assert "of 100 commands in the arena corridor, with 30 nodes" in figure5._claim(
        settings, {1: stuck}
    )
