"""The same controller with the same seed decides the same, whatever carries its line."""

from pathlib import Path

import pytest
from emulator_process import emulator, free_endpoint
from khepera_protocol.zenoh.controller_payloads import Decision
from made_once import made_once
from short_training import train_shortly

from macor_hil.runs.live_run import serve
from macor_hil.runs.options import RunOptions

ARENA, SEED = "open-box", 3
PORT = f"khepera://{ARENA}?seed={SEED}&baud=unpaced"
COMMANDS = 24

ABOUT_THE_SAME = 2
"""Counts (0.16 mm): a wheel that is still settling stands elsewhere when the next command comes."""


@pytest.fixture(scope="module")
def map_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def train(folder: Path) -> None:
        train_shortly(folder / "short.npz", PORT, tuning=20, random=200)

    return made_once(tmp_path_factory, "map-of-decisions", train) / "short.npz"


def drive(port: str, map_file: Path, connect: tuple[str, ...] = ()) -> list[Decision]:
    """Decisions of a run. The camera is looked through once a command: more pictures would make
    the noise of the next one another."""
    decisions: list[Decision] = []
    options = RunOptions(
        port=port,
        map_file=map_file,
        speed=60,
        acceleration=255,
        planner="anticipative",
        commands=COMMANDS,
        listen=(),
        connect=connect,
        camera_limit=0.0,
    )
    assert serve(options, decisions.append).recoveries == 0
    return decisions


@pytest.fixture(scope="module")
def in_process(map_file: Path) -> list[Decision]:
    decisions = drive(PORT, map_file)
    assert len({decision.command for decision in decisions}) == 3
    assert len({decision.situation.node for decision in decisions}) > 3
    assert not decisions[-1].collided
    return decisions


def what(decisions: list[Decision]) -> list[tuple[int, str]]:
    return [(decision.situation.node, decision.command) for decision in decisions]


@pytest.mark.parametrize(
    "carrier", ["link", pytest.param("tcp", marks=pytest.mark.long), "rfc2217"]
)
def test_the_same_decisions_over_every_carrier(
    carrier: str, map_file: Path, in_process: list[Decision], tmp_path: Path
) -> None:
    endpoint = free_endpoint()
    place = str(tmp_path / "robot") if carrier == "link" else "127.0.0.1:0"
    with emulator(
        *("--arena", ARENA, "--seed", str(SEED), "--baud", "unpaced", "--speed", "10"),
        *("--listen", endpoint, f"--{carrier}", place),
    ) as running:
        decisions = drive(running.path, map_file, (endpoint,))
    assert what(decisions) == what(in_process)
    for one, other in zip(decisions, in_process, strict=True):
        counters = one.odometry.counters, other.odometry.counters
        assert all(abs(a - b) <= ABOUT_THE_SAME for a, b in zip(*counters, strict=True))
