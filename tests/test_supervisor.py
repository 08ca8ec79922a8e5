"""Signs of life for a supervisor such as systemd: a socket of our own stands for its."""

import os
import signal
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from emulator_process import PATIENCE, emulator
from khepera_protocol.system.supervisor import NOBODY, Supervisor
from made_once import made_once
from short_training import train_shortly

import macor_hil.hardware.devices
from macor_hil.errors import LinkError
from macor_hil.mind.planners.planner import Plan
from macor_hil.runs.live_run import serve
from macor_hil.runs.options import RunOptions

PORT = "khepera://corridor?seed=1&drift=none"
OFTEN = "4000"
"""Microseconds of a watchdog: a sign of life each millisecond."""


class Listener:
    """The supervisor's end of the line."""

    def __init__(self, address: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(address)
        self.socket.settimeout(PATIENCE)

    def hear(self) -> str:
        """The next message."""
        return self.socket.recv(4096).decode()

    def until(self, wanted: str) -> list[str]:
        """All messages up to one that begins so."""
        heard = [self.hear()]
        while not heard[-1].startswith(wanted):
            heard.append(self.hear())
        return heard

    def waiting(self) -> list[str]:
        """All that has come and was not heard yet."""
        heard = []
        self.socket.setblocking(False)
        try:
            while True:
                heard.append(self.hear())
        except BlockingIOError:
            return heard
        finally:
            self.socket.settimeout(PATIENCE)


@contextmanager
def listening(address: str) -> Iterator[Listener]:
    listener = Listener(address)
    try:
        yield listener
    finally:
        listener.socket.close()


@pytest.fixture
def listener(tmp_path: Path) -> Iterator[Listener]:
    with listening(str(tmp_path / "notify")) as listener:
        yield listener


@pytest.fixture
def environment(listener: Listener) -> dict[str, str]:
    return {"NOTIFY_SOCKET": listener.socket.getsockname(), "WATCHDOG_USEC": OFTEN}


@pytest.fixture(scope="module")
def map_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def train(folder: Path) -> None:
        train_shortly(folder / "short.npz", PORT, random=80)

    return made_once(tmp_path_factory, "map-of-service", train) / "short.npz"


@pytest.fixture
def options(map_file: Path) -> RunOptions:
    return RunOptions(port=PORT, map_file=map_file, commands=3, listen=(), connect=())


def test_nobody_is_told_anything_without_a_supervisor() -> None:
    for supervisor in (NOBODY, Supervisor.of({})):
        supervisor.ready("at work")
        supervisor.alive()
        supervisor.stopping()


def test_a_socket_without_a_file_is_found_too() -> None:
    name = f"khepera-macor-{os.getpid()}"
    with listening(f"\0{name}") as listener:
        Supervisor(f"@{name}").ready("at\nwork")
        assert listener.hear() == "READY=1\nSTATUS=at work"


def test_a_supervisor_that_has_gone_changes_nothing(tmp_path: Path) -> None:
    Supervisor(str(tmp_path / "none")).ready("at work")


@pytest.mark.parametrize(
    "environment",
    [{}, {"WATCHDOG_USEC": "0"}, {"WATCHDOG_USEC": "x"}, {"WATCHDOG_PID": "1"}],
)
def test_a_watchdog_that_is_not_ours_is_not_fed(
    listener: Listener, environment: dict[str, str]
) -> None:
    given = {"WATCHDOG_USEC": OFTEN} if "WATCHDOG_PID" in environment else {}
    address = listener.socket.getsockname()
    Supervisor.of({"NOTIFY_SOCKET": address, **given, **environment}).alive()
    assert listener.waiting() == []


def test_signs_of_life_are_not_given_more_often_than_wanted(listener: Listener) -> None:
    supervisor = Supervisor(listener.socket.getsockname(), period=3600.0)
    for _ in range(3):
        supervisor.alive()
    assert listener.waiting() == ["WATCHDOG=1"]


def test_the_emulator_gives_signs_of_life_from_begin_to_end(
    listener: Listener, environment: dict[str, str]
) -> None:
    with emulator("--no-zenoh", env={**os.environ, **environment}) as running:
        assert listener.until("READY=1")[-1] == "READY=1\nSTATUS=the robot is on"
        for _ in range(3):
            listener.until("WATCHDOG=1")
        assert running.end() == (0, "")
        listener.until("STOPPING=1")


def test_a_run_gives_signs_of_life_from_begin_to_end(
    options: RunOptions,
    listener: Listener,
    environment: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    heard = reading(listener)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    serve(options)
    messages = heard()
    ready = next(n for n, text in enumerate(messages) if text.startswith("READY=1"))
    assert messages[ready] == f"READY=1\nSTATUS=waits for {PORT}"
    assert "STATUS=driving" in messages[ready:]
    assert messages[ready:].count("WATCHDOG=1") > 3
    assert messages[-2:] == ["STOPPING=1", "STATUS=stopped: all commands driven"]


def reading(listener: Listener) -> Any:
    """Hear everything in a thread; what was heard is returned when it is called."""
    messages: list[str] = []

    def hear() -> None:
        messages.extend(listener.until("STATUS=stopped"))

    thread = threading.Thread(target=hear, daemon=True)
    thread.start()

    def heard() -> list[str]:
        thread.join(PATIENCE)
        return messages

    return heard


def test_a_run_that_waits_for_its_robot_is_ready_and_alive(
    options: RunOptions,
    listener: Listener,
    environment: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("macor_hil.runs.recovery._PAUSE", 0.002)
    looks: list[int] = []

    def absent(*_: Any) -> Any:
        looks.append(1)
        if len(looks) == 6:
            signal.raise_signal(signal.SIGTERM)
        raise LinkError("no adapter")

    monkeypatch.setattr(macor_hil.hardware.devices, "open_port", absent)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    serve(options.model_copy(update={"wait": 3600.0}))
    heard = listener.waiting()
    assert any(text.startswith("READY=1") for text in heard)
    assert "STATUS=starting: no adapter" in heard
    assert heard.count("WATCHDOG=1") > 2


LISTENERS: list[Listener] = []


class Hanging:
    """A planner that hangs for a while: no thread may say for it that all is well."""

    memory = "transitions"

    def plan(self, *_: object) -> Plan:
        (listener,) = LISTENERS
        listener.waiting()
        threading.Event().wait(0.05)
        assert [text for text in listener.waiting() if "WATCHDOG" in text] == []
        return Plan((None, None, 0.0), 2)


def test_a_run_that_hangs_gives_no_sign_of_life(
    options: RunOptions,
    listener: Listener,
    environment: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(f"{__name__}.LISTENERS", [listener])
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert serve(options.model_copy(update={"planner": f"{__name__}:Hanging"})).commands == 3
    assert "WATCHDOG=1" in listener.waiting()


def test_a_refused_configuration_is_never_ready(
    options: RunOptions,
    listener: Listener,
    environment: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(Exception, match="there is no map"):
        serve(options.model_copy(update={"map_file": tmp_path / "none.npz"}))
    assert listener.waiting() == []
