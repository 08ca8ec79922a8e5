"""Q-learning on maps that can be worked out by hand."""

import numpy as np
import pytest
from planning import plan, square

from macor_hil.mind.memories.q_map import QMap
from macor_hil.mind.memories.transitions import Competence, SensorimotorMap
from macor_hil.mind.planners.q_learning import QLearning
from macor_hil.mind.planners.reactive import Reactive


def test_the_first_adaptation_stores_what_was_earned() -> None:
    memory = QMap(3, 2, gamma=0.9)
    memory.adapt(0, 2, 0.5)
    assert square(memory, "w_r")[2, 0] == pytest.approx(0.5)


def test_what_follows_is_added_with_its_discount() -> None:
    memory = QMap(3, 2, gamma=0.9)
    memory.adapt(2, 4, 0.5)
    memory.adapt(2, 5, 0.7)
    memory.adapt(0, 2, 0.5)
    # equation 4 takes the better of the two that followed neuron 2
    assert square(memory, "w_r")[2, 0] == pytest.approx(0.5 + 0.9 * 0.7)


def test_the_learning_rate_is_one_over_the_count() -> None:
    memory = QMap(3, 2, gamma=0.5)
    memory.adapt(0, 2, 0.6)
    memory.adapt_last(2, 4, 0.0)
    memory.adapt(2, 5, 0.8)
    memory.adapt(0, 2, 0.6)
    # first target 0.6, second 0.6 + 0.5 * 0.8 = 1.0: their mean
    assert square(memory, "w_r")[2, 0] == pytest.approx(0.8)
    assert square(memory, "z")[2, 0] == 2


def test_nothing_follows_a_collision() -> None:
    memory = QMap(3, 2, gamma=0.9)
    memory.adapt(4, 3, 0.7)  # neuron 4 is also known from elsewhere
    memory.adapt_last(0, 4, 0.0)
    assert square(memory, "w_r")[4, 0] == 0.0


def test_negative_evaluations_are_not_hidden_by_unknown_ones() -> None:
    memory = QMap(3, 2, gamma=1.0)
    memory.adapt(2, 4, -1.0)
    memory.adapt(0, 2, 0.0)
    assert square(memory, "w_r")[2, 0] == pytest.approx(-1.0)


def test_gamma_zero_is_equation_2() -> None:
    rng = np.random.default_rng(1)
    weak = QMap(4, 3, gamma=0.0)
    plain = SensorimotorMap(4, 3, Competence(mu=-100.0))
    for _ in range(300):
        j, i = rng.integers(12, size=2)
        r = float(rng.choice([0.0, 0.54, 0.62]))
        weak.adapt(int(j), int(i), r)
        plain.adapt(int(j), int(i), r)
    assert (square(weak, "w_r") == square(plain, "w_r")).all()
    # as every competence is at its greatest, the reactive system decides alike
    for start in range(12):
        assert plan(QLearning(), weak, start).command == plan(Reactive(), plain, start).command


def test_the_plan_is_the_best_outcome_of_each_command() -> None:
    memory = QMap(3, 2, gamma=0.9)
    memory.adapt(0, 2, 0.5)
    memory.adapt(0, 4, 0.7)
    found = plan(QLearning(), memory, 0)
    assert found.evaluations == pytest.approx((0.7, None))
    assert found.command == 0
    assert found.sequence == (4,)
    assert plan(QLearning(), memory, 1).command is None
