"""Statistics against values worked out by hand."""

import numpy as np
import pytest

from macor_hil.experiments.report.statistics import (
    estimate,
    holm,
    interquartile_mean,
    mean,
    order,
    sign_flip_p,
    too_few,
)


def test_the_interquartile_mean_leaves_out_a_quarter_on_either_side() -> None:
    assert interquartile_mean([100, 2, 3, 4, 5, 6, 7, -100]) == pytest.approx(4.5)
    # of 5 to 7 values one goes on either side, of 3 none
    assert interquartile_mean([9.0, 1.0, 2.0, 3.0, -9.0]) == pytest.approx(2.0)
    assert interquartile_mean([1.0, 2.0, 6.0]) == pytest.approx(3.0)
    rows = np.array([[1.0, 2.0, 3.0, 10.0], [0.0, 4.0, 6.0, 50.0]])
    assert interquartile_mean(rows, axis=1) == pytest.approx([2.5, 5.0])


def test_the_interval_of_equal_values_is_that_value() -> None:
    same = estimate([8.0] * 5)
    assert (same.value, same.low, same.high) == (8.0, 8.0, 8.0)


def test_the_interval_of_a_coin_is_that_of_the_binomial() -> None:
    # means of 100 draws from 50 zeros and 50 ones: standard deviation 0.05
    coin = estimate([0.0, 1.0] * 50, mean)
    assert coin.value == 0.5
    assert coin.low == pytest.approx(0.5 - 1.96 * 0.05, abs=0.015)
    assert coin.high == pytest.approx(0.5 + 1.96 * 0.05, abs=0.015)
    assert estimate([0.0, 1.0] * 50, mean) == coin


def test_sign_flips_are_counted_exactly() -> None:
    # of the eight sign patterns only the observed one reaches the sum 6
    assert sign_flip_p([1.0, 2.0, 3.0]) == pytest.approx(1 / 8)
    # +-1 +-2 +-3 reaches 4 or more with (1, 2, 3), (-1, 2, 3)
    assert sign_flip_p([-1.0, 2.0, 3.0]) == pytest.approx(2 / 8)
    assert sign_flip_p([0.0, 0.0]) == 1.0
    assert sign_flip_p([-1.0, -2.0, -3.0]) == 1.0


def test_many_pairs_are_drawn() -> None:
    assert sign_flip_p([1.0] * 30) == pytest.approx(1 / 10_001)
    assert 0.3 < sign_flip_p([1.0, -1.0] * 15) < 0.7


def test_an_order_holds_with_interval_and_p() -> None:
    clear = order([3.0, 4.0, 5.0, 6.0, 7.0], [1.0, 2.0, 2.0, 3.0, 4.0])
    assert clear.difference.value == pytest.approx(2.6)
    assert clear.p == pytest.approx(1 / 32)
    assert (clear.wins, clear.ties, clear.seeds) == (5, 0, 5)
    assert clear.holds
    few = order([3.0, 4.0], [1.0, 2.0])
    assert few.difference.low > 0
    assert not few.holds
    mixed = order([1.0, 1.0, 0.0, 5.0, 0.0], [0.0, 1.0, 4.0, 0.0, 1.0])
    assert (mixed.wins, mixed.ties) == (2, 1)
    assert not mixed.holds


def test_holm_keeps_what_holds_together() -> None:
    # 0.05 / 3, / 2, / 1: the last one is not looked at any more
    assert holm([0.04, 0.01, 0.03]) == [False, True, False]
    assert holm([0.04, 0.01, 0.02]) == [True, True, True]
    assert holm([0.02, 0.02, 0.04]) == [False, False, False]
    assert holm([]) == []


def test_few_seeds_cannot_show_anything() -> None:
    # the least p of four pairs is 1/16, of five 1/32
    assert "With 4 seeds p < 0.05 cannot be reached" in too_few(4)
    assert too_few(5) == ""
    assert "With 5 seeds p < 0.05 in 2 tests at the same time cannot" in too_few(5, 2)
    assert too_few(6, 2) == ""
