"""Graded situations: memberships, shared-out counts, and the planner between the nodes."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from as_type import as_type
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from planning import moment

from macor_hil.commands import COMMANDS, LEFT, RIGHT, STRAIGHT
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.experience import Experience, Moment
from macor_hil.mind.memories.graded import GradedMap, GradedMemory
from macor_hil.mind.memories.prototypes import Prototypes, memberships, placed
from macor_hil.mind.planners.graded import Graded
from macor_hil.mind.settings import MindSettings, Part


def at(*shares: float) -> np.ndarray:
    return np.array(shares, dtype=float)


def now(*shares: float) -> Moment:
    return moment(features=at(*shares))


def memory_of(graded: GradedMap) -> GradedMemory:
    """A memory of counts whose inputs are memberships already."""
    memory = GradedMemory(graded.nodes, graded.commands, graded.nodes, lambda x: x)
    memory.situations, memory.counts = SimpleNamespace(memberships=lambda x: x), graded
    return memory


@given(arrays(float, st.integers(1, 8), elements=st.floats(0, 20)))
def test_memberships_sum_to_one_and_fall_with_distance(distances: np.ndarray) -> None:
    shares = memberships(distances)
    assert shares.shape == distances.shape
    assert shares.sum() == pytest.approx(1.0)
    order = np.argsort(distances, kind="stable")
    assert (np.diff(shares[order]) <= 1e-12).all()


def test_a_membership_falls_to_one_in_e_at_the_width() -> None:
    shares = memberships(np.array([0.0, 0.3]), width=0.3)
    assert shares[1] / shares[0] == pytest.approx(np.exp(-1))


def test_distances_are_how_far_an_input_lies_outside_each_box() -> None:
    art = FuzzyArt(2, 3, vigilance=0.8)
    art.load({"weights": np.array([[0.2, 0.2, 0.6, 0.7], [0.9, 0.9, 0.1, 0.1]])})
    # the first box goes from (0.2, 0.2) to (0.4, 0.3)
    assert art.distances(np.array([0.3, 0.25])) == pytest.approx([0.0, 1.25])
    assert art.distances(np.array([0.5, 0.1])) == pytest.approx([0.1 + 0.1, 1.2])


def test_an_input_belongs_to_the_prototypes_around_it() -> None:
    prototypes = Prototypes(np.array([[0.0, 0.0], [1.0, 0.0]]), width=0.5)
    assert prototypes.memberships(np.array([0.5, 0.3])) == pytest.approx([0.5, 0.5])
    near, far = prototypes.memberships(np.array([0.2, 0.0]))
    assert far / near == pytest.approx(np.exp((0.2 - 0.8) / 0.5))


def test_prototypes_are_spread_over_all_that_was_seen() -> None:
    rng = np.random.default_rng(5)
    groups = rng.uniform(size=(4, 6))
    # most inputs look alike; the others get prototypes all the same
    inputs = np.repeat(groups, [900, 40, 30, 30], axis=0) + rng.normal(0.0, 0.003, (1000, 6))
    found = placed(inputs, 4, rng).centres
    nearest = np.abs(found[:, None] - groups).sum(axis=2).argmin(axis=1)
    assert sorted(nearest) == [0, 1, 2, 3]
    assert np.abs(found - groups[nearest]).max() < 0.01


def test_the_same_seed_places_the_same_prototypes() -> None:
    inputs = np.random.default_rng(1).uniform(size=(300, 8))
    first, again, other = (placed(inputs, 20, np.random.default_rng(s)).centres for s in (7, 7, 8))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_few_inputs_make_equal_prototypes() -> None:
    inputs = np.array([[0.1, 0.9], [0.8, 0.2]])
    prototypes = placed(inputs, 5, np.random.default_rng(1))
    assert prototypes.centres.shape == (5, 2)
    assert {tuple(row.round(5)) for row in prototypes.centres} == {(0.1, 0.9), (0.8, 0.2)}


SMALL = MindSettings(nodes=6, eyes=Part("receptive-fields"))


def test_what_a_brain_experiences_it_knows_for_the_mirror_image_too() -> None:
    rng = np.random.default_rng(2)
    brain = build_brain(SMALL)
    seen = rng.uniform(size=(40, brain.eyes.size))
    brain.tune(seen, rng)
    left, right = COMMANDS.index(LEFT), COMMANDS.index(RIGHT)

    def live(brain: Brain, frames: np.ndarray, without: int, into: int) -> GradedMap:
        for raw, then in pairwise(frames):
            for command, collided in ((without, False), (into, True)):
                before = brain.perceive(raw, command, learn=True)
                after = brain.perceive(then, command, learn=True)
                r = brain.earned(command, collided=collided)
                brain.learn(Experience(before, command, after, r, collided))
        return as_type(GradedMemory, brain.memories["graded"]).counts

    turned = build_brain(SMALL)
    turned.eyes.load(brain.eyes.state())
    as_type(GradedMemory, turned.memories["graded"]).situations = as_type(
        GradedMemory, brain.memories["graded"]
    ).situations
    graded = live(brain, seen, left, right)
    mirrored = live(turned, brain.eyes.mirrored(seen), right, left)
    np.testing.assert_allclose(mirrored.led_to, graded.led_to)
    np.testing.assert_allclose(mirrored.earned, graded.earned)
    # a collision is followed by nothing, a drive by something, whichever way round
    assert graded.led_to[:, left].sum() == pytest.approx(39)
    assert graded.tried[:, left].sum() == pytest.approx(78)
    assert not graded.led_to[:, COMMANDS.index(STRAIGHT)].any()


def test_an_experience_is_shared_out_among_the_situations() -> None:
    graded = GradedMap(3, 2)
    graded.count(at(0.75, 0.25, 0), 1, at(0, 0.5, 0.5), 0.6)
    assert graded.tried[:, 1] == pytest.approx([0.75, 0.25, 0])
    assert graded.earned[:, 1] == pytest.approx([0.45, 0.15, 0])
    assert graded.led_to[0, 1] == pytest.approx([0, 0.375, 0.375])
    chance, reward = graded.outcomes(doubt=0.0 + 1e-12)
    assert chance[1, 1] == pytest.approx([0, 0.5, 0.5])
    assert reward[:2, 1] == pytest.approx([0.6, 0.6])


def test_nothing_follows_a_collision_and_doubt_lowers_what_was_tried_once() -> None:
    graded = GradedMap(2, 1)
    graded.count(at(1, 0), 0, None, 0.0)
    graded.count(at(0, 1), 0, at(0, 1), 0.5)
    chance, reward = graded.outcomes(doubt=1.0)
    assert chance[0, 0].sum() == 0.0
    assert chance[1, 0].sum() == pytest.approx(0.5)
    assert reward[1, 0] == pytest.approx(0.25)


def test_values_solve_bellmans_equation() -> None:
    rng = np.random.default_rng(3)
    graded = GradedMap(5, 2)
    for _ in range(400):
        b, then = rng.dirichlet(np.ones(5)), rng.dirichlet(np.ones(5))
        graded.count(b, int(rng.integers(2)), then if rng.random() < 0.9 else None, rng.random())
    chance, reward = graded.outcomes(doubt=1.0)
    planner = Graded(gamma=0.8, settled=1e-12)
    q = np.array([planner.plan(memory_of(graded), now(*row)).evaluations for row in np.eye(5)])
    np.testing.assert_allclose(q, reward + 0.8 * chance @ q.max(axis=1), atol=1e-9)


def test_it_decides_by_all_situations_that_it_is_in() -> None:
    graded = GradedMap(3, 2)
    for _ in range(50):
        graded.count(at(1, 0, 0), 0, at(1, 0, 0), 0.6)
        graded.count(at(1, 0, 0), 1, at(1, 0, 0), 0.5)
        graded.count(at(0, 1, 0), 0, None, 0.0)
        graded.count(at(0, 1, 0), 1, at(1, 0, 0), 0.5)
    planner = Graded()
    assert planner.plan(memory_of(graded), now(1, 0, 0)).command == 0
    # mostly in the first situation, and still the danger of the second decides
    assert planner.plan(memory_of(graded), now(0.7, 0.3, 0)).command == 1


def test_hypotheses_lead_along_the_strongest_situations() -> None:
    graded = GradedMap(3, 2)
    for _ in range(200):
        graded.count(at(1, 0, 0), 1, at(0, 1, 0), 0.5)
        graded.count(at(0, 1, 0), 0, at(0, 0, 1), 0.5)
        graded.count(at(0, 0, 1), 0, None, 0.0)
    plan = Graded().plan(memory_of(graded), now(1, 0, 0))
    assert plan.command == 1
    assert plan.sequence == (1 * 2 + 1, 2 * 2 + 0)
    assert plan.hypotheses[0].evaluation == plan.evaluations[1]


def test_nothing_tried_means_no_plan() -> None:
    plan = Graded().plan(memory_of(GradedMap(3, 2)), now(1, 0, 0))
    assert plan.evaluations == (None, None)
    assert plan.command is None
    assert plan.sequence == ()


def test_stored_counts_must_fit() -> None:
    graded = GradedMap(3, 2)
    with pytest.raises(ValueError, match="tried"):
        graded.load(
            {"led_to": np.zeros((3, 2, 3)), "tried": np.zeros((3, 3)), "earned": np.zeros((3, 2))}
        )
