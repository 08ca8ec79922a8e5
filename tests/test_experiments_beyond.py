"""The experiments that go beyond the paper: their trials, their pictures, what they tell."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from as_type import as_type
from planning import square

from macor_hil.commands import COMMANDS, STRAIGHT
from macor_hil.experiments import goals
from macor_hil.experiments.beyond import BEYOND
from macor_hil.experiments.drift import DRIFT
from macor_hil.experiments.drives.course import Course, System, trial_from_json
from macor_hil.experiments.drives.systems import ANTICIPATIVE, GRADED, SYSTEMS, learn_all
from macor_hil.experiments.drives.training_drive import Drive, Recordings
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.goals import GOALS
from macor_hil.experiments.report.elements import Table, Text
from macor_hil.experiments.sweep.runner import reproduce
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.settings import MindSettings

DRIVE = Drive(tuning=10, random=24, reactive=6, brain=MindSettings(nodes=8))
COURSE = Course(trials=1, commands=2)


def tiny(experiment: Experiment, **changes: object) -> Experiment:
    return replace(
        experiment, settings=replace(experiment.settings, drive=DRIVE, nodes=8, **changes)
    )


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Recordings:
    return Recordings(tmp_path_factory.mktemp("recordings"), DRIVE)


def test_the_ablation_drives_every_system_in_every_arena(recordings: Recordings) -> None:
    courses = (COURSE, replace(COURSE, arena="s-curve", commands=3))
    experiment = tiny(BEYOND, courses=courses)
    result = experiment.trial(experiment.settings, 1, recordings)
    assert list(result["trials"]) == ["corridor", "s-curve"]
    assert {len(trials) for each in result["trials"].values() for trials in each.values()} == {1}
    assert experiment.draw(experiment.settings, {1: result})
    elements = experiment.tell(experiment.settings, {1: result})
    table = next(element for element in elements if isinstance(element, Table))
    assert [row[0] for row in table.rows] == ["corridor, 2", "s-curve, 3"]
    (verdict,) = (b.text for b in elements if isinstance(b, Text) and "where it was" in b.text)
    lengths = {
        place: trial_from_json(trials[GRADED][0]).length
        for place, trials in result["trials"].items()
    }
    assert f"graded drives {lengths['corridor']:.2f} of 2 commands" in verdict
    assert f"at least {lengths['s-curve']:.2f} of 3 commands" in verdict


def test_maps_are_driven_on_robots_with_other_drifts(recordings: Recordings) -> None:
    experiment = tiny(DRIFT, course=COURSE, driven=("none", "strong"))
    result = experiment.trial(experiment.settings, 1, recordings)
    trials = result["trials"]
    assert list(trials) == ["default", "none"]
    # the same start for all, and another way for every drift
    paths = [trials["default"][drift][ANTICIPATIVE][0]["path"] for drift in ("none", "strong")]
    assert paths[0][0] == paths[1][0]
    assert paths[0][1] != paths[1][1]
    assert experiment.draw(experiment.settings, {1: result})
    assert experiment.tell(experiment.settings, {1: result})


def transitions_of(system: System) -> SensorimotorMap:
    return as_type(SensorimotorMap, system.brain.memories["transitions"])


def test_a_changed_goal_is_learned_from_the_change_on(recordings: Recordings) -> None:
    experiment = tiny(GOALS, course=COURSE, looks=(0, 20))
    settings = experiment.settings
    system = learn_all(settings, recordings[1])[ANTICIPATIVE]
    same = goals._changed(settings, system, recordings[1], 0)
    before, unchanged = (transitions_of(one) for one in (system, same))
    np.testing.assert_array_equal(square(unchanged, "w_r"), square(before, "w_r"))
    np.testing.assert_array_equal(square(unchanged, "w_c"), square(before, "w_c"))
    changed = goals._changed(settings, system, recordings[1], 31)
    after = transitions_of(changed)
    # transitions by straight on: they earn what they earn now
    straight = np.zeros(square(after, "w_r").shape, dtype=bool)
    straight[COMMANDS.index(STRAIGHT) :: len(COMMANDS)] = True
    seen = (square(after, "w_r") != square(before, "w_r")) & straight
    assert seen.any()
    assert set(square(after, "w_r")[seen].round(6)) <= {0.1, 0.05}
    result = experiment.trial(settings, 1, recordings)
    assert list(result["after"]) == ["0", "20"]
    assert experiment.draw(settings, {1: result})
    assert experiment.tell(settings, {1: result})


def test_a_system_is_well_again_at_nine_tenths_of_one_trained_for_it() -> None:
    settings = replace(GOALS.settings, looks=(0, 100, 300))
    after = {"0": {GRADED: 1.0}, "100": {GRADED: 8.9}, "300": {GRADED: 9.0}}
    result = {"trained for it": {GRADED: 10.0}, "after": after}
    assert goals.commands_needed(settings, result, GRADED) == 300
    after["300"][GRADED] = 8.0
    assert goals.commands_needed(settings, result, GRADED) is None


def test_an_experiment_may_take_fewer_seeds(tmp_path: Path) -> None:
    experiment = replace(
        tiny(BEYOND, courses=(COURSE,)), most_seeds=1, draw=lambda *_: {}, tell=lambda *_: []
    )
    reproduce([experiment], 2, 1, tmp_path, lambda *_: None)
    (results,) = (tmp_path / "results").glob("beyond-*.jsonl")
    assert len(results.read_text().splitlines()) == 2


def test_all_systems_share_their_situations(recordings: Recordings) -> None:
    systems = learn_all(tiny(BEYOND).settings, recordings[1])
    assert tuple(systems) == SYSTEMS
    assert len({id(system.brain.clusterer) for system in systems.values()}) == 1
