"""TD-FALCON in the table of the others: what it is taught, what it chooses, what is told of it."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from as_type import not_none
from planning import moment

from macor_hil.errors import MacorError
from macor_hil.experiments import peers
from macor_hil.experiments.catalogue import EXPERIMENTS, find
from macor_hil.experiments.drives.course import Course
from macor_hil.experiments.drives.falcon import MEMORY, Falcon, FalconPlanner, Parameters
from macor_hil.experiments.drives.training_drive import PUT_DOWN, Drive, Recording, Recordings
from macor_hil.experiments.peers import FALCON, PEERS
from macor_hil.experiments.report.elements import Table, Text
from macor_hil.experiments.sweep.runner import COSTS, reproduce
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.experience import Experience
from macor_hil.mind.planners.planner import Plan
from macor_hil.mind.settings import MindSettings

DRIVE = Drive(tuning=10, random=24, reactive=6, brain=MindSettings(nodes=8))
EXPERIMENT = replace(
    PEERS,
    settings=replace(
        PEERS.settings,
        drive=DRIVE,
        nodes=8,
        first=20,
        candidates=(Parameters(), Parameters(state=0.8)),
        course=Course(trials=2, commands=2),
    ),
)
NAMES = [f"{FALCON}, {candidate}" for candidate in EXPERIMENT.settings.candidates]
COMMANDS = np.array([PUT_DOWN, 0, 2, PUT_DOWN, PUT_DOWN, 1, 2])


@pytest.fixture
def recording() -> Recording:
    """Two commands, the second a collision; nothing; two commands without one."""
    brain = build_brain()
    raw = np.random.default_rng(0).uniform(size=(len(COMMANDS), brain.eyes.raw_size))
    return Recording(brain, raw, COMMANDS, np.arange(len(COMMANDS)) == 2, 70.0)


class Network:
    """Keeps what it is taught; straight on and a turn to the left are worth the same."""

    def __init__(self) -> None:
        self.taught: list[tuple[np.ndarray, ...]] = []
        self.asked: list[np.ndarray] = []
        self.fusion_art = SimpleNamespace(W=[])

    def prepare_data(self, *channels: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(np.hstack([channel, 1.0 - channel]) for channel in channels)

    def partial_fit(self, *channels: np.ndarray) -> None:
        self.taught.append(channels)
        self.fusion_art.W.append(None)

    def get_actions_and_rewards(
        self, state: np.ndarray, action_space: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        self.asked.append(state)
        return action_space, np.array([[0.5], [0.25], [0.5]])


def learned(falcon: Falcon, recording: Recording) -> Falcon:
    replace(recording.brain, memories={MEMORY: falcon}).relive(recording.seen())
    assert falcon.nodes  # all episodes have ended
    return falcon


def test_a_drive_is_cut_where_the_robot_was_put_down(recording: Recording) -> None:
    network = Network()
    learned(Falcon(network, discount=0.0), recording)
    first, _, second = network.taught
    np.testing.assert_array_equal(first[0][:, :36], recording.inputs[:2])
    np.testing.assert_array_equal(second[0][:, :36], recording.inputs[4:6])
    assert first[1][:, :3].argmax(axis=1).tolist() == [0, 2]
    assert second[1][:, :3].argmax(axis=1).tolist() == [1, 2]
    assert first[2][:, 0].tolist() == [0.54, 0.0]
    assert second[2][:, 0].tolist() == [0.54, 0.62]


def test_the_beginning_of_a_drive_is_a_drive(recording: Recording) -> None:
    part = recording.first(3)
    assert part.commands.tolist() == COMMANDS[:6].tolist()
    np.testing.assert_array_equal(part.raw, recording.raw[:6])
    assert part.collided.tolist() == recording.collided[:6].tolist()
    assert part.robot_seconds == pytest.approx(60.0)
    assert recording.first(100).commands.tolist() == COMMANDS.tolist()


def test_after_a_collision_a_command_is_worth_what_it_earned(recording: Recording) -> None:
    network = Network()
    falcon = learned(Falcon(network, discount=0.75), recording)
    sequence, last, second = network.taught
    assert [channel.shape for channel in sequence] == [(2, 72), (2, 6), (2, 2)]
    assert sequence[1][:, :3].tolist() == [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    # a quarter of what it earned: values stay below 1
    np.testing.assert_allclose(sequence[2][:, 0], [0.135, 0.0])
    for whole, alone in zip(sequence, last, strict=True):
        np.testing.assert_array_equal(whole[-1:], alone)
    assert [len(states) for states, _, _ in network.taught] == [2, 1, 2]
    # neither ended nor followed: nothing can be said of its worth
    before, after = moment(features=second[0][0, :36]), moment(features=second[0][1, :36])
    falcon.learn(Experience(before, 1, after, 0.54, False))
    assert falcon.nodes == 3


def test_it_takes_the_best_command_at_what_it_sees() -> None:
    network = Network()
    x = np.linspace(0.0, 1.0, 36)
    plan = FalconPlanner().plan(Falcon(network, 0.5), moment(features=x))
    assert plan == Plan((0.5, 0.25, 0.5), 0)
    np.testing.assert_array_equal(network.asked[0], np.concatenate([x, 1.0 - x]))


def test_it_runs_by_its_name_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    assert PEERS in EXPERIMENTS
    monkeypatch.setitem(sys.modules, "artlib", None)
    assert PEERS not in find("all")
    with pytest.raises(MacorError, match=r"^artlib is not installed; .* 'peers' with: .*\[peers\]"):
        find("peers")


@pytest.fixture
def without_artlib(monkeypatch: pytest.MonkeyPatch) -> None:
    """Networks that learn nothing in place of artlib's."""
    monkeypatch.setattr(peers, "version", lambda _: "0.0")

    monkeypatch.setattr(Falcon, "of", lambda parameters, _: Falcon(Network(), parameters.discount))


@pytest.mark.usefixtures("without_artlib")
def test_all_learn_and_are_told_of_in_one_table(tmp_path: Path) -> None:
    page = reproduce([EXPERIMENT], 2, 1, tmp_path, lambda *_: None)
    (path,) = (tmp_path / "results").glob("peers-*")
    _, line, _ = path.read_text().splitlines()
    result = json.loads(line)["result"]
    # what learning took differs from run to run, so it is no result
    assert list(result) == ["artlib", "nodes", "trials"]
    costs = [json.loads(one)["what"] for one in (tmp_path / COSTS).read_text().splitlines()]
    assert [costs.count(f"peers: {name}") for name in NAMES] == [2, 2]
    assert list(result["nodes"]) == NAMES
    starts = {tuple(trials[1]["path"][0]) for trials in result["trials"].values()}
    assert len(result["trials"]) == 2 * 4 + 2
    assert len(starts) == 1
    assert (page.parent / "peers-lengths.png").exists()
    (table, order) = (
        block for block in EXPERIMENT.tell(EXPERIMENT.settings, {1: result}) if type(block) is Table
    )
    assert [row[0] for row in table.rows[:3]] == [*NAMES, "reactive, first 20"]
    assert table.rows[-1][0] == "graded, whole drive"
    assert [row[0] for row in order.rows[:4]] == [
        "graded over TD-FALCON",
        "TD-FALCON over anticipative",
        "TD-FALCON over q-learning",
        "TD-FALCON over reactive",
    ]


def result_of(lengths: dict[str, int]) -> dict[str, object]:
    own = [f"{n}, {part}" for n in peers.OWN for part in ("first 20", "whole drive")]
    trials = {
        name: [{"r": [0.5] * n, "collided": True, "touched": True, "path": [[0, 0, 0]] * (n + 1)}]
        for name, n in (dict.fromkeys(own, 8) | lengths).items()
    }
    return {"artlib": "0.0", "nodes": dict.fromkeys(NAMES, 5), "trials": trials}


def test_the_candidate_with_the_longest_trials_stands_for_it() -> None:
    settings = EXPERIMENT.settings
    results = {
        seed: result_of({NAMES[0]: 8, NAMES[1]: 9, "graded, first 20": 30}) for seed in range(1, 7)
    }
    assert peers.best(settings, results) == NAMES[1]
    said = " ".join(b.text for b in EXPERIMENT.tell(settings, results) if isinstance(b, Text))
    assert f"{NAMES[1]} drives longest: 9.00 (9.00 to 9.00) commands" in said
    assert "show: graded over TD-FALCON; TD-FALCON over anticipative;" in said
    results = dict.fromkeys(range(1, 7), result_of(dict.fromkeys(NAMES, 8)))
    assert peers.best(settings, results) == NAMES[0]
    said = " ".join(b.text for b in EXPERIMENT.tell(settings, results) if isinstance(b, Text))
    assert "show: none." in said


def test_artlib_learns_that_a_collision_is_worth_nothing() -> None:
    pytest.importorskip("artlib", reason="the extra 'peers' is not installed")
    free, wall = np.full(36, 0.1), np.full(36, 0.9)
    falcon = Falcon.of(Parameters(discount=0.5), 36)
    at_free, at_wall = moment(features=free), moment(features=wall)
    for turn in (0, 1):
        falcon.learn(Experience(at_free, 2, at_wall, 0.62, False))
        falcon.learn(Experience(at_wall, 2, at_wall, 0.0, True))
        falcon.learn(Experience(at_free, 2, at_wall, 0.62, False))
        falcon.learn(Experience(at_wall, turn, at_free, 0.54, False))
        falcon.learn(Experience(at_free, 2, moment(features=free), 0.62, False))
    plan = FalconPlanner().plan(falcon, at_wall)
    left, right, straight = plan.evaluations
    assert straight == pytest.approx(0.0)
    assert min(not_none(left), not_none(right)) > 0.2
    assert falcon.nodes >= 4


def test_with_artlib_the_same_seed_gives_the_same_result(tmp_path: Path) -> None:
    pytest.importorskip("artlib", reason="the extra 'peers' is not installed")
    recordings = Recordings(tmp_path, DRIVE)
    one, two = (EXPERIMENT.trial(EXPERIMENT.settings, 1, recordings) for _ in range(2))
    del one["took"], two["took"]
    assert one == two
    assert all(1 < n <= 20 for n in one["nodes"].values())
    x = recordings[1].inputs
    falcons = [learned(Falcon.of(Parameters(), 36), recordings[1]) for _ in range(2)]
    first, second = (
        [FalconPlanner().plan(falcon, moment(features=row)) for row in x] for falcon in falcons
    )
    assert first == second
