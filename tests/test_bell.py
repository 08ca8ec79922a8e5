"""A bell wakes who waits for it, and touches nothing once it is closed."""

import os
import select
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from khepera_emulator.ports.bell import Bell


@pytest.fixture
def bell() -> Iterator[Bell]:
    bell = Bell()
    yield bell
    bell.close()


def rings(bell: Bell) -> bool:
    return bool(select.select([bell.fileno()], (), (), 0)[0])


def test_is_readable_from_ringing_to_silence(bell: Bell) -> None:
    assert not rings(bell)
    bell.ring()
    bell.ring()
    assert rings(bell)
    bell.silence()
    assert not rings(bell)
    bell.silence()
    assert not rings(bell)


def test_rings_no_more_when_closed_whatever_file_has_its_number_now(tmp_path: Path) -> None:
    bell = Bell()
    number = bell.fileno()
    other = os.open(tmp_path / "other", os.O_RDWR | os.O_CREAT)
    bell.close()
    os.dup2(other, number)
    bell.ring()
    bell.close()
    assert (tmp_path / "other").read_bytes() == b""
    os.close(number)
    os.close(other)


def test_may_be_rung_by_a_signal_at_any_time(bell: Bell, monkeypatch: pytest.MonkeyPatch) -> None:
    before = signal.signal(signal.SIGUSR1, lambda *_: bell.ring())
    close = os.close

    def interrupted(descriptor: int) -> None:
        os.kill(os.getpid(), signal.SIGUSR1)
        close(descriptor)

    monkeypatch.setattr(os, "close", interrupted)
    bell.close()
    monkeypatch.undo()
    signal.signal(signal.SIGUSR1, before)
