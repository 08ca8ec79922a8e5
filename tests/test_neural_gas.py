"""Neural Gas: the rule of 1991 on small cases, the breadth search, the clusterer error."""

import numpy as np
import pytest

from macor_hil.mind.clusterers.clusterer import Clusterer
from macor_hil.mind.clusterers.clusterer_error import clusterer_errors, situations
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.clusterers.neural_gas import Annealing, Breadth, NeuralGas, search, trained


def corners(count: int, seed: int = 0) -> np.ndarray:
    """Inputs near three corners of the unit square."""
    rng = np.random.default_rng(seed)
    places = np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])
    return np.clip(places[rng.integers(3, size=count)] + rng.normal(0, 0.02, (count, 2)), 0, 1)


def gas_at(weights: list[list[float]], annealing: Annealing) -> NeuralGas:
    gas = NeuralGas(len(weights[0]), len(weights), annealing)
    gas.weights[:] = weights
    return gas


def test_nodes_move_by_their_rank() -> None:
    gas = gas_at([[0.0], [0.4], [1.0]], Annealing((0.5, 0.5), (1.0, 1.0), 10))
    assert gas.present(np.array([0.5])).node == 1
    e = np.exp(-1.0)
    # ranks: 0.4 is nearest; 0.0 and 1.0 are equally far, and the first comes first
    expected = [0.0 + 0.5 * e * 0.5, 0.4 + 0.5 * 0.1, 1.0 - 0.5 * e * e * 0.5]
    assert gas.weights[:, 0] == pytest.approx(expected)


def test_rate_and_radius_fall_by_equal_factors() -> None:
    annealing = Annealing((0.8, 0.2), (8.0, 0.5), 100)
    assert annealing.at(0) == (0.8, 8.0)
    assert annealing.at(50) == pytest.approx((0.4, 2.0))
    assert annealing.at(100) == pytest.approx((0.2, 0.5))
    assert annealing.at(1000) == pytest.approx((0.2, 0.5))


def test_recognising_changes_nothing() -> None:
    gas = NeuralGas(2, 4, Annealing(steps=10), seed=3)
    before = gas.weights.copy()
    seen = gas.present(np.array([0.3, 0.6]), learn=False)
    assert (gas.weights == before).all()
    assert gas.steps == 0
    assert seen.resonant
    assert seen.match == pytest.approx(1 - np.abs(before[seen.node] - [0.3, 0.6]).sum() / 2)


def test_the_match_is_that_of_a_fuzzy_art_box_of_one_point() -> None:
    gas = gas_at([[0.2, 0.7]], Annealing(steps=10))
    art = FuzzyArt(2, 1, 0.5)
    art.present(np.array([0.2, 0.7]))
    x = np.array([0.5, 0.1])
    assert gas.present(x, learn=False).match == pytest.approx(art.present(x, learn=False).match)


def test_training_finds_the_clusters() -> None:
    gas = trained(corners(600), 3, Annealing((0.5, 0.01), (2.0, 0.1), 600), seed=1)
    found = sorted(gas.centres().round(1).tolist())
    assert found == [[0.1, 0.1], [0.1, 0.9], [0.9, 0.1]]


def test_the_search_takes_the_smallest_error() -> None:
    inputs = corners(200)
    good, bad = Annealing((0.5, 0.01), (2.0, 0.1), 200), Annealing((1e-6, 1e-6), (2.0, 0.1), 200)
    assert search(inputs, 3, [bad, good, bad], seed=1) == good


def test_breadth_tries_every_combination() -> None:
    tried = Breadth((0.1, 0.2), (0.01,), (5.0, 6.0, 7.0), (0.1,)).annealings(50)
    assert len(tried) == len(set(tried)) == 6
    assert all(annealing.steps == 50 for annealing in tried)


def test_the_error_is_the_distance_to_the_middle_of_the_node() -> None:
    art: Clusterer = FuzzyArt(2, 2, 0.5)
    inputs = np.array([[0.2, 0.2], [0.4, 0.2]])
    assert situations(art, inputs, learn=True).tolist() == [0, 0]
    # the box reaches from 0.2 to 0.4, its middle is 0.3
    assert clusterer_errors(art, inputs) == pytest.approx([0.1, 0.1])
    gas: Clusterer = gas_at([[0.2, 0.6], [0.9, 0.9]], Annealing(steps=10))
    assert clusterer_errors(gas, inputs[:1]) == pytest.approx([0.4])


def test_many_inputs_give_what_each_gives() -> None:
    xs = np.random.default_rng(5).random((200, 7))
    each, many = (NeuralGas(7, 12, Annealing(radius=(3.0, 0.05), steps=200)) for _ in range(2))
    for x in xs:
        each.present(x)
    many.learn_all(xs)
    assert many.weights.tobytes() == each.weights.tobytes()
    assert many.steps == each.steps
    assert many.situations_of(xs).tolist() == situations(each, xs, learn=False).tolist()
