"""`khepera-emulator run --control`: resets and the truth over the daemon's standard input."""

import json
import subprocess
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from as_type import not_none
from emulator_process import PATIENCE, EmulatorProcess

Ask = Callable[[str], dict[str, Any]]


@pytest.fixture(scope="module")
def running() -> Iterator[EmulatorProcess]:
    options = ("--control", "--no-zenoh", "--arena", "open-box", "--robots", "2")
    process = EmulatorProcess(*options, stdin=subprocess.PIPE)
    not_none(process.process.stdout).readline()  # the other robot
    yield process
    process.end()


@pytest.fixture
def ask(running: EmulatorProcess) -> Ask:
    """Write a line, and read the answer."""
    requests, answers = not_none(running.process.stdin), not_none(running.process.stdout)

    def asked(line: str) -> dict[str, Any]:
        requests.write(line + "\n")
        requests.flush()
        answer: dict[str, Any] = json.loads(answers.readline())
        return answer

    return asked


def test_each_robot_is_asked_and_put(ask: Ask) -> None:
    place = {"x": 0.1, "y": 0.05, "heading": -0.5}
    before = ask("{}")["truth"]
    put = ask(json.dumps({"robot": 2, "reset": {"pose": place}}))["truth"]
    assert put["pose"] == pytest.approx(place)
    assert ask('{"robot": 2}')["truth"]["pose"] == put["pose"]
    now = ask('{"robot": 1}')["truth"]
    assert now["pose"] == before["pose"]
    assert now["time"] > before["time"]


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("hello", "Invalid JSON: expected value at line 1 column 1"),
        ('{"where": 1}', "where: Extra inputs are not permitted"),
        ('{"robot": 3}', "there is no robot 3: there are 2"),
        ('{"reset": {"pose": {"x": 9, "y": 9, "heading": 0}}}', "x=9.000 m, y=9.000 m is outside"),
        ("x" * 50_000, "it has "),
    ],
)
def test_what_is_no_request_is_answered_with_a_sentence(ask: Ask, line: str, sentence: str) -> None:
    answer = ask(line)
    assert answer["error"].startswith(sentence)
    assert "truth" not in answer


def test_the_daemon_ends_with_its_input() -> None:
    running = EmulatorProcess("--control", "--no-zenoh", stdin=subprocess.PIPE)
    said = running.process.communicate("{}\n", timeout=PATIENCE)
    assert json.loads(said[0])["truth"]["touched"] is False
    assert running.process.returncode == 0
