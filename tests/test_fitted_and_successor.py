"""Fitted Q iteration and the successor representation, on drives whose values are known."""

import numpy as np
import pytest

from macor_hil.arrays import Array
from macor_hil.mind.experience import Experience, Moment, Resonance
from macor_hil.mind.memories.fitted_q import FittedQMemory
from macor_hil.mind.memories.successor import SuccessorMap
from macor_hil.mind.planners.fitted_q import FittedQ
from macor_hil.mind.planners.successor import Successor

M = 3
"""Commands."""


def moment(node: int, x: Array | None = None) -> Moment:
    features = np.eye(4)[node] if x is None else x
    return Moment(features, features, Resonance(node, True, 1.0), node * M)


def step(k: int, a: int, r: float, then: int, collided: bool = False) -> Experience:
    return Experience(moment(k), a, moment(then), r, collided)


LEFT, RIGHT, AHEAD = 0, 1, 2
WORLD = [
    # round and round between situations 0 and 1; straight ahead earns more, once
    step(0, LEFT, 0.5, 1),
    step(1, LEFT, 0.5, 0),
    step(0, AHEAD, 0.6, 2),
    step(2, AHEAD, 0.0, 3, collided=True),
]
FOR_EVER = 0.5 / (1.0 - 0.9)


def learned() -> SuccessorMap:
    memory = SuccessorMap(4, M, rate=0.5)
    for _ in range(200):
        for each in WORLD:
            memory.learn(each)
    return memory


def test_successors_are_counted_with_the_best_commands_after_them() -> None:
    memory = learned()
    plan = Successor().plan(memory, moment(0))
    assert plan.command == LEFT
    assert plan.evaluations[LEFT] == pytest.approx(FOR_EVER, rel=1e-3)
    assert plan.evaluations[RIGHT] is None
    assert plan.evaluations[AHEAD] == pytest.approx(0.6)
    # half of all that follows is the command itself, every other time
    assert memory.follows[LEFT, LEFT] == pytest.approx(1.0 / (1.0 - 0.9**2), rel=1e-3)
    assert memory.follows.sum(axis=1).max() <= 10.0


def test_other_rewards_change_all_values_at_once() -> None:
    memory = learned()
    before = memory.follows.copy()
    memory.earned[:] *= 2.0
    values, tried = memory.values(0)
    assert values[LEFT] == pytest.approx(2.0 * FOR_EVER, rel=1e-3)
    assert tried.tolist() == [True, False, True]
    assert (memory.follows == before).all()


def test_successors_that_cannot_have_been_learned_are_refused() -> None:
    memory = SuccessorMap(2, M)
    memory.learn(step(0, LEFT, 0.5, 1))
    for name, bad in (
        ("follows", np.full((6, 6), 9.0, np.float32)),
        ("tried", np.array([1, 2])),
        ("earned", np.full(6, np.nan)),
    ):
        with pytest.raises(ValueError, match=r"follow|counts|earned"):
            SuccessorMap(2, M).load(memory.state() | {name: bad})


def test_fitted_values_are_those_of_the_world() -> None:
    memory = FittedQMemory(M, 4, ridge=1e-6, sweeps=200)
    for each in WORLD * 20:
        memory.learn(each)
    plan = FittedQ().plan(memory, moment(0))
    assert plan.command == LEFT
    assert plan.evaluations[LEFT] == pytest.approx(FOR_EVER, rel=1e-2)
    assert plan.evaluations[RIGHT] is None
    assert plan.evaluations[AHEAD] == pytest.approx(0.6, abs=1e-2)
    fallen = FittedQ().plan(memory, moment(2))
    assert fallen.evaluations[AHEAD] == pytest.approx(0.0, abs=1e-2)


def test_fitted_values_are_linear_in_the_features() -> None:
    rng = np.random.default_rng(1)
    memory = FittedQMemory(M, 2, gamma=0.0, ridge=1e-6)
    for x in rng.uniform(size=(200, 2)):
        for command in range(M):
            there = moment(0, x)
            memory.learn(Experience(there, command, there, float(x[0] + command * x[1]), False))
    x = np.array([0.3, 0.9])
    expected = [0.3 + command * 0.9 for command in range(M)]
    assert FittedQ().plan(memory, moment(0, x)).evaluations == pytest.approx(expected, abs=1e-3)


def test_fitted_values_never_promise_more_than_there_is() -> None:
    memory = FittedQMemory(M, 2, ridge=1e-6)
    rng = np.random.default_rng(2)
    for x in rng.uniform(0.4, 0.6, size=(300, 2)):
        memory.learn(Experience(moment(0, x), 0, moment(0, np.sign(x - 0.5)), 0.5, False))
    (value, *_) = memory.evaluations(np.array([0.5, 0.5]))
    assert value is not None
    assert 0.5 < value < FOR_EVER


def test_fitted_values_follow_what_is_learned_later() -> None:
    memory = FittedQMemory(M, 4, experiences=4)
    for each in WORLD:
        memory.learn(each)
    before = memory.evaluations(np.eye(4)[0])
    memory.learn(step(0, RIGHT, 0.9, 1))
    after = memory.evaluations(np.eye(4)[0])
    assert before[RIGHT] is None
    assert after[RIGHT] is not None
    # the oldest one has gone
    assert len(memory.state()["commands"]) == 4
    assert memory.state()["commands"][-1] == RIGHT


def test_nothing_is_known_before_anything_is_learned() -> None:
    assert FittedQ().plan(FittedQMemory(M, 4), moment(0)).command is None
    assert Successor().plan(SuccessorMap(4, M), moment(0)).command is None
