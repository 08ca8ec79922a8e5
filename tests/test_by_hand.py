"""A drive by keys on a terminal: what it does, what is learned from it, and every way out of it."""

import os
import re
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from drives import MACOR_HIL, SLOW, STATUSES, WAYS_OUT, Drive
from emulator_process import PATIENCE, free_endpoint
from hand_drives import teleop
from rig import Rig, rig

from macor_hil.errors import MacorError, RobotError
from macor_hil.hardware.robots.robot import RobotKind
from macor_hil.mind.catalogue import build_brain
from macor_hil.runs.by_hand.keyboard import Key, keys_of
from macor_hil.runs.by_hand.options import TeleopOptions
from macor_hil.runs.by_hand.teleop import teleop as teleop_in_process
from macor_hil.runs.learning.recorded_drives import learn
from macor_hil.telemetry.recordings.recording import play_recording, read_recording
from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.wishes.stop_key import ask_to_stop

LIMIT = 0.3
"""Seconds within which a program stops its robot; one that is left alone stands a little later."""

ALONE = 0.5


def macor_hil(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*MACOR_HIL, *arguments],
        cwd=folder,
        timeout=2 * PATIENCE,
        check=False,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )


@pytest.mark.parametrize(
    ("data", "keys", "rest"),
    [
        (b"wad", [Key.STRAIGHT, Key.LEFT, Key.RIGHT], b""),
        (b"W S\x04x", [Key.STRAIGHT, Key.STOP, Key.BACK, Key.END, Key.END], b""),
        (b"\x1b[A\x1bOD\x1b[C\x1b[B", [Key.STRAIGHT, Key.LEFT, Key.RIGHT, Key.BACK], b""),
        (b"q\x1b[", [Key.TURN_LEFT], b"\x1b["),
        (b"e\x1b", [Key.TURN_RIGHT], b"\x1b"),
        (b"\x1b[Z\x00\xffk", [], b""),
    ],
)
def test_keys_are_read_from_what_a_terminal_sends(
    data: bytes, keys: list[Key], rest: bytes
) -> None:
    assert keys_of(data) == (keys, rest)


@pytest.fixture(scope="module")
def shared_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with rig(tmp_path_factory.mktemp("by-hand")) as running:
        yield running


@pytest.fixture
def bench(shared_bench: Rig) -> Iterator[Rig]:
    shared_bench.make_ready()
    yield shared_bench
    shared_bench.end_controllers()


@pytest.mark.long
@pytest.mark.wall_clock
def test_a_drive_by_keys_trains_a_map_that_drives(bench: Rig, tmp_path: Path) -> None:
    recording, learned = tmp_path / "hand.mcap", tmp_path / "learned.npz"
    drive = teleop(bench, "--record", str(recording))
    keys = b"wwaddwqwsewa"
    commands = 0
    for number, key in enumerate(keys):
        drive.answer(bytes([key]))
        said = {ord("q"): b"turn left", ord("e"): b"turn right", ord("s"): b"back"}.get(key)
        if said is None:
            said = f"{commands:3}  ".encode()
            commands += 1
        drive.wait_for(said)
        assert number < len(keys)
    drive.answer(b"x")
    assert drive.wait() == 0
    drive.wait_for(b"the robot stands")
    assert f"{commands} commands; the robot stands".encode() in drive.said
    leaves = {getattr(event, "leaf", "alive") for event in read_recording(recording)[1]}
    assert {"frame", "decision", "state", "map", "truth", "wire", "alive"} <= leaves
    done = macor_hil("learn", str(recording), "--map", str(learned), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f" from {commands} commands" in done.stdout
    assert not done.stderr
    run = macor_hil(
        *("run", "--map", str(learned), "--port", str(bench.link), "--baud", str(bench.baud)),
        *("--connect", bench.endpoint, "--listen", bench.controller_endpoint),
        *("--commands", "3", "--planner", "expected"),
        folder=tmp_path,
    )
    assert run.returncode in (0, 3), run.stderr
    assert re.search(r"\d commands, reinforcement", run.stdout)


def test_a_drive_in_virtual_time_trains_a_map(tmp_path: Path) -> None:
    """The same in one process: each key is pressed when the one before has been carried out."""
    master, terminal = os.openpty()
    keys = iter("wadqwswex")

    def press(_: str) -> None:
        os.write(master, next(keys).encode())

    recording, endpoint = tmp_path / "hand.mcap", free_endpoint()
    options = TeleopOptions(
        port="khepera://open-box?seed=1", record=recording, listen=(endpoint,), connect=()
    )
    try:
        report = teleop_in_process(options, terminal, press)
    finally:
        os.close(terminal)
        os.close(master)
    assert (report.commands, report.signal) == (5, "")
    brain = build_brain()
    events = play_recording(recording)[1]
    assert learn(brain, [events], np.random.default_rng(1)) == 5
    assert brain.transitions > 0


ENDS: dict[str, tuple[Callable[[Drive], None], int | None]] = {
    **{name: (end, STATUSES[name]) for name, end in WAYS_OUT.items()},
    "the key Ctrl-C": (lambda drive: drive.answer(b"\x03"), 130),
    "x": (lambda drive: drive.answer(b"x"), 0),
    "Ctrl-D": (lambda drive: drive.answer(b"\x04"), 0),
    "SIGKILL": (lambda drive: drive.signal(signal.SIGKILL), -signal.SIGKILL),
    "SIGSTOP": (lambda drive: drive.signal(signal.SIGSTOP), None),
}


def test_the_kind_of_robot_that_is_named_is_driven() -> None:
    master, terminal = os.openpty()
    os.write(master, b"x")
    options = TeleopOptions(
        port="khepera://corridor",
        robot_kind=RobotKind.EPUCK,
        listen=(free_endpoint(),),
        connect=(),
    )
    with pytest.raises(RobotError):
        teleop_in_process(options, terminal, lambda _: None)


@pytest.mark.wall_clock
@pytest.mark.parametrize(
    "way",
    [
        pytest.param(
            way, marks=() if way in ("terminal closed", "x", "SIGKILL") else pytest.mark.long
        )
        for way in ENDS
    ],
)
def test_every_way_out_stops_the_robot(bench: Rig, way: str) -> None:
    end, status = ENDS[way]
    drives: list[Drive] = []

    def attempt() -> None:
        bench.make_ready()
        drives.append(teleop(bench, "--speed", str(SLOW)))
        drives[-1].answer(b"w")
        bench.wait_until_moving()
        end(drives[-1])

    assert bench.stops_within(ALONE if way in ("SIGKILL", "SIGSTOP") else LIMIT, attempt)
    assert status is None or drives[-1].wait() == status
    assert b"Traceback" not in drives[-1].said


@pytest.mark.wall_clock
def test_the_stop_keys_of_terminal_and_network_stop_the_robot(bench: Rig) -> None:
    drive = teleop(bench, "--speed", str(SLOW), "--stop-key")

    def press(key: bytes) -> Callable[[], None]:
        def attempt() -> None:
            drive.answer(b"w")
            bench.wait_until_moving()
            drive.answer(key)

        return attempt

    assert bench.stops_within(LIMIT, press(b" "))
    drive.wait_for(b"stopped")
    with open_session([], [bench.controller_endpoint]) as session:
        drive.answer(b"d")
        bench.wait_until_moving()
        ask_to_stop(session, "khepera")
        assert bench.time_to_stand() < LIMIT
    assert drive.wait() == 0
    drive.wait_for(b"ended by the stop key; 0 commands; the robot stands")


@pytest.mark.long
@pytest.mark.wall_clock
def test_a_failing_camera_stops_a_drive_by_hand(bench: Rig) -> None:
    drives: list[Drive] = []

    def attempt() -> None:
        bench.make_ready()
        drives.append(teleop(bench, "--speed", str(SLOW)))
        drives[-1].answer(b"w")
        bench.wait_until_moving()
        assert bench.relay is not None
        bench.relay.mode = "lost"

    assert bench.stops_within(0.5, attempt)
    assert drives[-1].wait() == 4
    drives[-1].wait_for(b"no picture")


@pytest.mark.long
@pytest.mark.wall_clock
def test_at_a_wall_only_the_way_back_is_driven(bench: Rig) -> None:
    drive = teleop(bench, "--infrared", "1")
    drive.answer(b"w")
    drive.wait_for(b"COLLISION")
    drive.answer(b"w")
    drive.wait_for(b"something is in the way")
    drive.answer(b"s")
    drive.wait_for(b"back")
    drive.answer(b"x")
    assert drive.wait() == 0
    drive.wait_for(b"1 commands; the robot stands")


def test_without_a_terminal_nothing_is_driven() -> None:
    reading, writing = os.pipe()
    try:
        with pytest.raises(MacorError, match="read from a terminal"):
            teleop_in_process(TeleopOptions(), reading, print)
    finally:
        os.close(reading)
        os.close(writing)
