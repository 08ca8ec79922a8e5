"""The sensorimotor map and the planners on small maps that can be worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planning import plan, square

from macor_hil.mind.memories.transitions import Competence, SensorimotorMap
from macor_hil.mind.planners.anticipative import Anticipative
from macor_hil.mind.planners.expected import Expected, pooled_outcomes
from macor_hil.mind.planners.planner import best_command
from macor_hil.mind.planners.reactive import Reactive

KNOWN = 50  # adaptations after which a transition is as competent as can be


def memory_of(*transitions: tuple[int, int, float], nodes: int = 6) -> SensorimotorMap:
    """A map of two commands with well-known transitions (j, i, r)."""
    memory = SensorimotorMap(nodes, 2)
    for j, i, r in transitions:
        for _ in range(KNOWN):
            memory.adapt(j, i, r)
    return memory


def test_competence_rises_with_adaptation_to_below_one() -> None:
    weights = Competence()(np.arange(12))
    assert weights[0] == 0.0
    assert (np.diff(weights) > 0).all()
    assert weights[-1] < 0.95
    assert weights[-1] == pytest.approx(0.95)
    # equation 1 at z = mu gives half of the greatest weight
    assert Competence(mu=3.0)(np.array([3]))[0] == pytest.approx(0.475)


def test_the_evaluation_is_the_mean_of_what_a_transition_earned() -> None:
    memory = SensorimotorMap(1, 2)
    for r in (0.7, 0.5, 0.0):
        memory.adapt(0, 1, r)
    assert square(memory, "z")[1, 0] == 3
    assert square(memory, "w_r")[1, 0] == pytest.approx(0.4)


def test_reactive_takes_the_best_next_step_and_looks_no_further() -> None:
    # command 1 earns more at once, and then nothing; command 0 earns steadily
    memory = memory_of((0, 3, 0.7), (3, 5, 0.0), (0, 2, 0.5), (2, 4, 0.5), (4, 6, 0.5))
    assert plan(Reactive(), memory, 0).command == 1
    assert plan(Anticipative(), memory, 0).command == 0
    assert plan(Anticipative(), memory, 0).sequence == (2, 4, 6)


def test_evaluations_follow_equations_5_and_6() -> None:
    memory = memory_of((0, 2, 0.5), (2, 4, 0.7))
    found = plan(Anticipative(), memory, 0)
    w = 0.95
    assert found.evaluations == pytest.approx((0.5 * w + 0.7 * w * w, None))
    assert found.steps == 2


def test_a_neuron_hangs_on_the_predecessor_of_its_greatest_activity() -> None:
    # neuron 4 is reached at once by command 0 and over a detour by command 1: the detour is cut
    memory = memory_of((0, 4, 0.1), (0, 3, 0.1), (3, 4, 0.9), (4, 6, 0.9))
    found = plan(Anticipative(), memory, 0)
    assert found.evaluations[1] == pytest.approx(0.1 * 0.95)
    assert found.evaluations[0] == pytest.approx(0.1 * 0.95 + 0.9 * 0.95**2)


def test_a_transition_back_to_the_start_is_worth_itself() -> None:
    memory = memory_of((0, 0, 0.7), (0, 3, 0.5))
    found = plan(Reactive(), memory, 0)
    assert found.evaluations == pytest.approx((0.7 * 0.95, 0.5 * 0.95))


def test_each_first_transition_is_a_hypothesis_with_its_best_continuation() -> None:
    memory = memory_of((0, 2, 0.5), (2, 4, 0.7), (0, 6, 0.6), (0, 3, 0.1), (3, 5, 0.2), (3, 7, 0.1))
    found = plan(Anticipative(), memory, 0)
    assert [hypothesis.neurons for hypothesis in found.hypotheses] == [(2, 4), (6,), (3, 5)]
    w = 0.95
    assert found.hypotheses[1].evaluation == pytest.approx(0.6 * w)
    assert found.hypotheses[0].evaluation == found.evaluations[0]
    assert found.hypotheses[2].evaluation == found.evaluations[1]
    assert found.activities[0] == 1.0
    assert found.activities[4] == pytest.approx(w * w)
    assert found.activities[1] == 0.0


def test_of_equal_hypotheses_the_one_of_the_chosen_command_is_first() -> None:
    found = plan(Anticipative(), memory_of((0, 3, 0.5), (0, 2, 0.5)), 0)
    assert found.command == 0
    assert [hypothesis.neurons for hypothesis in found.hypotheses] == [(2,), (3,)]


def test_expected_value_weighs_a_sequence_for_each_command() -> None:
    found = plan(Expected(), memory_of((0, 2, 0.5), (2, 5, 0.7), (0, 3, 0.1)), 0)
    assert [hypothesis.neurons for hypothesis in found.hypotheses] == [(2, 5), (3, 5)]
    assert found.hypotheses[0].neurons == found.sequence
    assert found.hypotheses[1].evaluation == found.evaluations[1]


def test_rare_transitions_are_devalued() -> None:
    memory = memory_of((0, 3, 0.5))
    memory.adapt(0, 2, 0.9)
    assert plan(Reactive(), memory, 0).command == 1


def test_a_situation_without_any_transition_has_no_plan() -> None:
    found = plan(Anticipative(), SensorimotorMap(3, 2), 1)
    assert found.command is None
    assert found.evaluations == (None, None)


def test_the_first_of_equal_commands_is_best() -> None:
    assert best_command((0.5, 0.5, None)) == 0
    assert best_command((None, None)) is None


@given(
    st.lists(
        st.tuples(st.integers(0, 11), st.integers(0, 11), st.sampled_from([0.0, 0.5, 0.7])),
        max_size=200,
    ),
    st.integers(0, 11),
)
def test_planning_ends_and_sequences_never_meet_a_neuron_twice(
    transitions: list[tuple[int, int, float]], start: int
) -> None:
    memory = SensorimotorMap(6, 2)
    for j, i, r in transitions:
        memory.adapt(j, i, r)
    found = plan(Anticipative(), memory, start)
    path = (start, *found.sequence)
    assert len(set(path)) == len(path)
    weighed = [hypothesis.neurons for hypothesis in found.hypotheses]
    # a transition back to the start is worth itself: nothing is expected beyond it
    assert weighed[:1] in ([], [found.sequence], [(start,)])
    tried = {i % 2 for j, i, _ in transitions if j == start}
    known = {a for a, value in enumerate(found.evaluations) if value is not None}
    # a transition whose neuron is reached better in another way is no alternative
    assert known <= tried
    assert (found.command is None) == (not known)


def test_expected_value_weighs_outcomes_by_their_counts() -> None:
    memory = SensorimotorMap(6, 2)
    # command 0 mostly earns 0.6, command 1 earned 0.9 once and 0 three times
    for i, r in ((2, 0.6), (2, 0.6), (3, 0.9), (5, 0.0), (5, 0.0), (5, 0.0)):
        memory.adapt(0, i, r)
    found = plan(Expected(), memory, 0)
    assert found.evaluations == pytest.approx((0.6, 0.225))
    assert found.command == 0
    # the paper's planner looks at the best outcome of each
    assert found.sequence == (2,)


def test_expected_value_pools_the_ways_into_a_situation() -> None:
    memory = SensorimotorMap(3, 2)
    memory.adapt(0, 2, 0.4)  # situation 0, entered by command 0
    memory.adapt(1, 2, 0.6)  # situation 0, entered by command 1
    chance, r = pooled_outcomes(memory)
    assert chance[0, 0].tolist() == [0.0, 1.0, 0.0]
    assert r[0, 0, 1] == pytest.approx(0.5)


def test_expected_value_is_the_discounted_sum_over_a_loop() -> None:
    memory = memory_of((0, 0, 1.0))
    found = plan(Expected(gamma=0.9, max_steps=500), memory, 0)
    assert found.evaluations[0] == pytest.approx(1.0 / (1.0 - 0.9), rel=1e-3)


def test_expected_value_without_any_transition_has_no_plan() -> None:
    found = plan(Expected(), SensorimotorMap(3, 2), 1)
    assert (found.command, found.sequence) == (None, ())


def test_planning_takes_the_greatest_activity_of_a_large_sparse_map() -> None:
    # activities as by the plain iteration of equation 5 over all neurons at once
    rng = np.random.default_rng(5)
    memory = SensorimotorMap(40, 3)
    for _ in range(900):
        j, i = rng.integers(120, size=2)
        memory.adapt(int(j), int(i), float(rng.random()))
    w_c = square(memory, "w_c")
    for start in range(0, 120, 17):
        y_a = np.zeros(120)
        y_a[start] = 1.0
        for _ in range(200):
            y_a = np.maximum(y_a, (w_c * np.where(y_a >= 1e-3, y_a, 0.0)).max(axis=1))
        np.testing.assert_array_equal(plan(Anticipative(), memory, start).activities, y_a)
