"""The thread that tells: in order, to the end, whatever fails."""

import threading
import time
from functools import partial

import pytest
from khepera_protocol.zenoh.payloads import Stamp

from macor_hil.errors import TelemetryError
from macor_hil.telemetry.sender import Sender


def test_everything_is_carried_out_in_order_before_the_end() -> None:
    done: list[int] = []
    with Sender() as sender:
        for number in range(200):
            sender.carry_out(partial(done.append, number))
    assert done == list(range(200))


def test_nobody_waits_for_what_takes_long() -> None:
    go, done = threading.Event(), []
    with Sender() as sender:
        begin = time.monotonic()
        sender.carry_out(lambda: go.wait(30))
        sender.carry_out(lambda: done.append(threading.current_thread()))
        assert time.monotonic() - begin < 5
        assert not done
        go.set()
    assert done[0] is not threading.current_thread()


@pytest.mark.parametrize("value", [-1, None])
def test_a_payload_out_of_bounds_is_a_failure_and_no_defect(
    value: int | None, caplog: pytest.LogCaptureFixture
) -> None:
    with Sender() as sender:
        sender.carry_out(lambda: Stamp(sequence=value, time=0.0))  # type: ignore[arg-type]
    sender._thread.join(30)
    assert "could not be told" in caplog.text
    assert "has failed" not in sender._thread.ended()


def test_a_failure_is_logged_and_the_next_one_is_carried_out(
    caplog: pytest.LogCaptureFixture,
) -> None:
    done = []

    def fail() -> None:
        raise TelemetryError("no picture")

    with Sender() as sender:
        sender.carry_out(fail)
        sender.carry_out(lambda: done.append(1))
    assert done == [1]
    assert "no picture" in caplog.text


def test_a_defect_ends_it_and_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading, "excepthook", lambda _: None)
    with Sender() as sender:
        sender.check()
        sender.carry_out(lambda: 1 / 0)
        sender._thread.join(30)
        with pytest.raises(TelemetryError, match=r"can be told .* any more: .*ZeroDivisionError"):
            sender.check()
        for _ in range(10):  # nothing gathers for nobody
            sender.carry_out(lambda: None)
        assert sender._actions.empty()


def test_what_is_not_carried_out_in_time_is_dropped_and_counted(
    caplog: pytest.LogCaptureFixture,
) -> None:
    go = threading.Event()
    with Sender() as sender:
        for _ in range(1000):
            sender.carry_out(lambda: go.wait(30))
        assert sender._actions.qsize() <= 300
        go.set()
    assert "samples are dropped" in caplog.text
    assert "samples were not told" in caplog.text
