"""`khepera-emulator place|reset|truth|watch`: robots that run already."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from as_type import not_none
from emulator_process import PATIENCE, EmulatorProcess, free_endpoint
from typer.testing import CliRunner

from khepera_emulator.app.cli.commands import app
from khepera_emulator.errors import EmulatorError

PROGRAM = (sys.executable, "-m", "khepera_emulator.app.cli")

Command = Callable[..., str]


@pytest.fixture(scope="module")
def world() -> Iterator[str]:
    """Return the endpoint of a world of two robots."""
    endpoint = free_endpoint()
    options = ("--robots", "2", "--arena", "open-box", "--seed", "1")
    running = EmulatorProcess(*options, "--listen", endpoint)
    yield endpoint
    running.end()


@pytest.fixture
def told(world: str) -> Command:
    """Run a command on the world; its output."""

    def run(*arguments: str) -> str:
        done = CliRunner().invoke(app, [*arguments, "--connect", world])
        if isinstance(done.exception, EmulatorError):
            raise done.exception
        assert done.exit_code == 0, done.output
        return done.stdout

    return run


def truths(text: str) -> dict[str, dict[str, Any]]:
    found = map(json.loads, text.splitlines())
    return {each.pop("robot"): each for each in found}


def test_each_robot_is_told_in_a_line(told: Command) -> None:
    told("reset", "--seed", "1")
    first, second = told("truth").splitlines()
    assert first.startswith("khepera-1  ")
    assert " s  x  0.0000 m  y  0.0000 m  heading  0.0000  wheels  0.0000  0.0000 m/s" in first
    assert second.startswith("khepera-2  ")


def test_a_robot_is_placed_by_its_name(told: Command) -> None:
    told("reset", "--seed", "1")
    before = truths(told("truth", "--json"))
    placed = truths(told("place", "0.3", "-0.02", "-1.5", "--robot", "khepera-1", "--json"))
    now = truths(told("truth", "--json"))
    assert now["khepera-1"]["pose"] == placed["khepera-1"]["pose"]
    assert placed["khepera-1"]["pose"] == pytest.approx({"x": 0.3, "y": -0.02, "heading": -1.5})
    assert now["khepera-2"]["pose"] == before["khepera-2"]["pose"]


def test_a_seed_puts_every_robot_where_it_started(told: Command) -> None:
    start = truths(told("reset", "--seed", "4", "--json"))
    told("place", "0.3", "0.1", "--robot", "khepera-2")
    again = truths(told("reset", "--seed", "4", "--json"))
    assert {name: each["pose"] for name, each in again.items()} == {
        name: each["pose"] for name, each in start.items()
    }
    by_chance = truths(told("reset", "--seed", "4", "--random", "--json"))
    assert all(by_chance[name]["pose"] != start[name]["pose"] for name in start)
    same = truths(told("reset", "--seed", "4", "--random", "--json"))
    assert all(same[name]["pose"] == by_chance[name]["pose"] for name in start)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ["place", "0", "0"],
            "there are several robots, khepera-1, khepera-2: name one with --rob",
        ),
        (["truth", "--robot", "khepra-2"], "there is no robot 'khepra-2'; did you mean khepera-2?"),
        (
            ["place", "9", "9", "--robot", "khepera-1"],
            "the emulator answers on khepera/khepera-1/reset: x=9.000 m, y=9.000 m is outside",
        ),
    ],
)
def test_a_refusal_is_a_sentence(told: Command, arguments: list[str], sentence: str) -> None:
    with pytest.raises(EmulatorError) as caught:
        told(*arguments)
    assert str(caught.value).startswith(sentence)


def test_a_place_takes_negative_numbers_and_no_unknown_option(told: Command) -> None:
    told("place", "-0.3", "-.1", "-1", "--robot", "khepera-1")
    refused = CliRunner().invoke(app, ["place", "0", "0", "--rbot", "khepera-1"])
    assert refused.exit_code == 2


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
def test_watching_goes_on_until_it_is_told_to_end(
    world: str, number: signal.Signals, status: int
) -> None:
    with watching(world) as watcher:
        output = not_none(watcher.stdout)
        times = [json.loads(output.readline())["time"] for _ in range(6)][::2]
        assert times[0] < times[1] < times[2]
        watcher.send_signal(number)
        said = watcher.communicate(timeout=PATIENCE)[1]
    assert (watcher.returncode, "Traceback" in said) == (status, False)


def test_watching_ends_when_nobody_reads(world: str) -> None:
    with watching(world) as watcher:
        output = not_none(watcher.stdout)
        output.readline()
        output.close()
        said = not_none(watcher.stderr).read()
        watcher.wait(PATIENCE)
    assert (watcher.returncode, said) == (
        2,
        "khepera-emulator: nobody reads the standard output\n",
    )


def watching(world: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*PROGRAM, "watch", "--rate", "50", "--json", "--connect", world],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_without_an_emulator_it_says_so() -> None:
    endpoint = free_endpoint()
    done = subprocess.run(
        [*PROGRAM, "truth", "--connect", endpoint],
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"khepera-emulator: no emulator answers on {endpoint}; start one with `khepera-emulator"
        " run`, or name its --listen endpoint with --connect\n"
    )


def test_help_says_which_robots_without_a_name() -> None:
    def text(command: str) -> str:
        words = CliRunner().invoke(app, [command, "--help"]).output.replace("│", " ").split()
        return " ".join(words)

    assert "without it the only one that is found" in text("place")
    for command in ("reset", "truth", "watch"):
        assert "without it all that are found" in text(command)
