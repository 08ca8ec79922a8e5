"""Fuzzy ART: resonance, fast learning, the cap on nodes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from macor_hil.mind.clusterers.clusterer_error import situations
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt

inputs = st.lists(
    st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3), min_size=1, max_size=30
).map(np.array)


def search(art: FuzzyArt, x: np.ndarray) -> int | None:
    """Textbook search: nodes by descending choice, the first that passes vigilance."""
    coded = np.concatenate([x, 1 - x])
    overlaps = [np.minimum(coded, w).sum() for w in art.weights]
    choices = [o / (art.alpha + w.sum()) for o, w in zip(overlaps, art.weights, strict=True)]
    for k in np.argsort(choices, kind="stable")[::-1]:
        if overlaps[k] >= art.vigilance * art.features:
            return int(k)
    return None


def test_the_first_input_makes_a_node_of_its_complement_code() -> None:
    art = FuzzyArt(features=2, nodes=3, vigilance=0.9)
    assert art.present(np.array([0.2, 0.7])).node == 0
    assert art.weights.tolist() == [[0.2, 0.7, 0.8, 0.30000000000000004]]


def test_fast_learning_shrinks_weights_to_the_common_part() -> None:
    art = FuzzyArt(features=2, nodes=3, vigilance=0.5)
    art.present(np.array([0.2, 0.7]))
    seen = art.present(np.array([0.4, 0.6]))
    assert seen.node == 0
    assert seen.resonant
    assert art.weights[0] == pytest.approx([0.2, 0.6, 0.6, 0.3])
    assert art.centres()[0] == pytest.approx([0.3, 0.65])


def test_without_a_free_node_the_nearest_box_answers_and_keeps_its_weights() -> None:
    art = FuzzyArt(features=1, nodes=2, vigilance=0.95)
    art.present(np.array([0.1]))
    art.present(np.array([0.9]))
    before = art.weights.copy()
    seen = art.present(np.array([0.6]))
    assert (seen.node, seen.resonant) == (1, False)
    assert (art.weights == before).all()
    assert art.size == 2


def test_an_empty_network_cannot_only_recognise() -> None:
    with pytest.raises(ValueError, match="empty network"):
        FuzzyArt(features=1, nodes=2, vigilance=0.5).present(np.array([0.5]), learn=False)


@given(inputs, st.floats(0.5, 0.99))
def test_the_winner_is_that_of_the_textbook_search(xs: np.ndarray, vigilance: float) -> None:
    art = FuzzyArt(features=3, nodes=50, vigilance=vigilance)
    for x in xs:
        expected = search(art, x)
        size = art.size
        seen = art.present(x)
        if expected is None:
            assert seen.node == size
        else:
            coded = np.concatenate([x, 1 - x])
            w, e = art.weights[seen.node], art.weights[expected]
            # nodes that tie to the last bit may be taken either way
            assert seen.node == expected or np.minimum(coded, w).sum() / (
                art.alpha + w.sum()
            ) == pytest.approx(np.minimum(coded, e).sum() / (art.alpha + e.sum()))


@given(inputs)
def test_what_was_learned_is_never_lost(xs: np.ndarray) -> None:
    art = FuzzyArt(features=3, nodes=4, vigilance=0.8)
    learned = [(x, seen.node) for x in xs if (seen := art.present(x)).resonant]
    for x, node in learned:
        lower, upper = art.weights[node][:3], 1 - art.weights[node][3:]
        assert (lower <= x + 1e-12).all()
        assert (x <= upper + 1e-12).all()
    # no box grows beyond what the vigilance allows: |w| >= rho M
    assert (art.weights.sum(axis=1) >= 0.8 * 3 - 1e-9).all()


@given(inputs, st.floats(0.5, 0.99))
def test_many_inputs_give_what_each_gives(xs: np.ndarray, vigilance: float) -> None:
    art = FuzzyArt(xs.shape[1], 3, vigilance)
    with pytest.raises(ValueError, match="can only learn"):
        art.situations_of(xs)
    situations(art, xs[: len(xs) // 2 + 1], learn=True)
    assert art.situations_of(xs).tolist() == situations(art, xs, learn=False).tolist()
