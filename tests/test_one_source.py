"""One source of pictures, whoever else answers; on a clock of the test's."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from macor_hil.errors import CameraLostError, CameraSourceError
from macor_hil.hardware.cameras.one_source import SETTLING, OneSource, Round


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def a_round(*sources: str, refusing: list[str] | tuple[()] = ()) -> Round[str]:
    """A question that these have answered, and nobody else does."""
    answers: Round[str] = Round()
    for source in sources:
        answers.add(source, f"picture of {source}")
    for source in refusing:
        answers.refuse(source, "no")
    answers.close()
    return answers


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def source(clock: Clock) -> OneSource[str]:
    return OneSource("the key", clock)


def test_who_answers_alone_is_chosen_and_kept(source: OneSource[str]) -> None:
    assert source.pick(a_round(), 1.0) is None
    assert source.pick(a_round("a"), 1.0) == "picture of a"
    assert source.pick(a_round("b", "a"), 1.0) == "picture of a"
    assert source.chosen == "a"


def test_nobody_is_chosen_among_several(source: OneSource[str]) -> None:
    with pytest.raises(CameraSourceError, match=r"2 sources answer on the key \(a and b\)"):
        source.pick(a_round("b", "a"), 1.0)
    assert source.chosen is None
    assert source.pick(a_round("b"), 1.0) == "picture of b"


def test_a_change_is_told_for_a_second_before_it_is_followed(
    source: OneSource[str], clock: Clock
) -> None:
    source.pick(a_round("a"), 1.0)
    for _ in range(3):
        with pytest.raises(CameraSourceError, match=r"another source than before \(b instead of a"):
            source.pick(a_round("b"), 1.0)
        clock.now += SETTLING / 4
    assert source.pick(a_round("a", "b"), 1.0) == "picture of a"  # it is back, and b a stranger
    assert source.pick(a_round("b"), 1.0) is None
    with pytest.raises(CameraSourceError):
        source.pick(a_round("b", "c"), 1.0)
    clock.now += SETTLING
    assert source.pick(a_round("b", "c"), 1.0) == "picture of c"


def test_a_source_that_has_gone_is_not_followed_by_one_of_several(
    source: OneSource[str], clock: Clock
) -> None:
    source.pick(a_round("a"), 1.0)
    with pytest.raises(CameraSourceError):
        source.pick(a_round("b", "c"), 1.0)
    clock.now += SETTLING
    with pytest.raises(CameraSourceError, match="2 sources"):
        source.pick(a_round("b", "c"), 1.0)


def test_who_answers_late_is_a_stranger_too(source: OneSource[str], clock: Clock) -> None:
    source.pick(a_round("a"), 1.0)
    answers: Round[str] = Round()
    answers.add("a", "picture of a")
    source.pick(answers, 1.0)
    answers.add("b", "late")
    clock.now += 10.0
    assert source.pick(a_round("b"), 1.0) is None


def test_an_error_counts_where_it_is_the_source_s(source: OneSource[str]) -> None:
    with pytest.raises(CameraLostError, match="the camera on the key answers: no"):
        source.pick(a_round(refusing=["a"]), 1.0)
    assert source.pick(a_round("a", refusing=["b"]), 1.0) == "picture of a"
    assert source.pick(a_round("a", refusing=["b"]), 1.0) == "picture of a"
    with pytest.raises(CameraLostError, match="answers: no"):
        source.pick(a_round(refusing=["a"]), 1.0)


@given(st.lists(st.tuples(st.permutations("abc"), st.integers(0, 3), st.floats(0.0, 2.0))))
def test_no_picture_ever_comes_from_who_answered_beside_the_source(
    rounds: list[tuple[list[str], int, float]],
) -> None:
    clock = Clock()
    source: OneSource[str] = OneSource("the key", clock)
    beside: set[str] = set()
    before = None
    for order, number, seconds in rounds:
        answering = order[:number]
        try:
            picture = source.pick(a_round(*answering), 1.0)
        except CameraSourceError:
            before = None
        else:
            if picture is not None:
                taken = picture[-1]
                assert taken not in beside
                assert before in (None, taken), "a change that was not told"
                before = taken
                beside |= set(answering) - {taken}
        clock.now += seconds
