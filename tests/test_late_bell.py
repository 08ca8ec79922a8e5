"""The bell that rings while something takes too long."""

import threading

import pytest
from controller_helpers import PATIENCE

from macor_hil.errors import MacorError
from macor_hil.safety.late_bell import LateBell


def test_it_rings_while_something_takes_too_long_and_says_so_afterwards() -> None:
    rung, said = threading.Event(), []
    with LateBell(0.0, rung.set) as bell:
        for number in (1, 2):
            with bell.timing(lambda: said.append(1)):
                assert rung.wait(PATIENCE)
                assert len(said) == number - 1
            assert len(said) == number
            rung.clear()


def test_it_is_quiet_where_nothing_does() -> None:
    rung = []
    with LateBell(60.0, lambda: rung.append(1)) as bell:
        for _ in range(100):
            with bell.timing(lambda: rung.append(2)):
                pass
    bell._thread.join(PATIENCE)
    assert bell._thread.ended()
    assert not rung


def test_it_ends_after_an_interrupt_at_any_place() -> None:
    bell = LateBell(60.0, lambda: None)
    with pytest.raises(KeyboardInterrupt), bell, bell.timing(lambda: None):
        raise KeyboardInterrupt
    bell._thread.join(PATIENCE)
    assert bell._thread.ended()
    with LateBell(60.0, lambda: None) as bell:
        bell._marks.put(True)  # and nothing after it
    bell._thread.join(PATIENCE)
    assert bell._thread.ended()


def test_a_broken_bell_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading, "excepthook", lambda _: None)
    with (
        LateBell(0.0, lambda: 1 / 0) as bell,
        pytest.raises(MacorError, match=r"not watched any more: .*ZeroDivisionError"),
        bell.timing(lambda: None),
    ):
        bell._thread.join(PATIENCE)
