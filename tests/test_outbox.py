"""The thread that tells: in order, to the end, whatever fails."""

import threading
import time

from macor_hil.errors import TelemetryError
from macor_hil.telemetry.outbox import Outbox


def test_everything_is_carried_out_in_order_before_the_end():
    done = []
    with Outbox() as outbox:
        for number in range(200):
            outbox.carry_out(lambda number=number: done.append(number))
    assert done == list(range(200))


def test_nobody_waits_for_what_takes_long():
    go, done = threading.Event(), []
    with Outbox() as outbox:
        begin = time.monotonic()
        outbox.carry_out(lambda: go.wait(30))
        outbox.carry_out(lambda: done.append(threading.current_thread()))
        assert time.monotonic() - begin < 5
        assert not done
        go.set()
    assert done[0] is not threading.current_thread()


def test_a_failure_is_logged_and_the_next_one_is_carried_out(caplog):
    done = []

    def fail():
        raise TelemetryError("no picture")

    with Outbox() as outbox:
        outbox.carry_out(fail)
        outbox.carry_out(lambda: done.append(1))
    assert done == [1]
    assert "no picture" in caplog.text
