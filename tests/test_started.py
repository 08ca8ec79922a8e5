"""`khepera_emulator.start`: a robot in a process of its own, for the tests of others."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import serial
from emulator_process import PATIENCE, has_ended

import khepera_emulator
from khepera_emulator import EmulatorError, StartedRobot
from khepera_emulator.app.testing.report import report, whole_replies
from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.line.wire_log import Entry, read_log

START = load_arena("s-curve").start


@pytest.fixture(scope="module")
def robot() -> Iterator[StartedRobot]:
    with khepera_emulator.start(arena="s-curve", seed=1, fault="stray:at=9999") as started:
        yield started


def ask(robot: StartedRobot, request: bytes) -> bytes:
    with serial.Serial(robot.port, timeout=PATIENCE) as port:
        port.write(request + b"\n")
        return port.readline()


def test_its_terminal_is_a_robots(robot: StartedRobot) -> None:
    assert ask(robot, b"B") == b"b,5.01,5.00\r\n"


def test_it_is_put_somewhere_and_back(robot: StartedRobot) -> None:
    placed = robot.place(START.x + 0.02, START.y, 0.1)
    wanted = {"x": START.x + 0.02, "y": START.y, "heading": 0.1}
    assert placed.pose.model_dump() == pytest.approx(wanted)
    assert robot.truth().pose == placed.pose
    assert robot.reset().pose.x == START.x
    assert robot.reset(seed=3, random=True).pose == robot.reset(seed=3, random=True).pose


def test_what_it_cannot_do_is_a_sentence_and_changes_nothing(robot: StartedRobot) -> None:
    before = robot.reset().pose
    with pytest.raises(EmulatorError, match=r"^x=9.000 m, y=9.000 m is outside the walls"):
        robot.place(9.0, 9.0)
    with pytest.raises(EmulatorError, match=r"^seed should be greater than or equal to 0, not -1"):
        robot.reset(seed=-1)
    with pytest.raises(EmulatorError, match=r"^pose.x should be a finite number"):
        robot.place(float("nan"), 0.0)
    assert robot.truth().pose == before


def test_its_wire_log_holds_what_was_said_up_to_now(robot: StartedRobot) -> None:
    before = len(robot.wire_log)
    ask(robot, b"G,7,8")
    ask(robot, b"H")
    added = list(whole_replies(robot.wire_log[before:]))
    said = [entry.data for entry in added if entry.what in ("request", "reply")]
    assert said == [b"G,7,8\n", b"g\r\n", b"H\n", b"h,7,8\r\n"]
    assert read_log(robot.log_file).url.startswith("khepera://s-curve?fault=stray")


def test_a_test_pays_for_what_it_uses_alone() -> None:
    program = "import sys, khepera_emulator; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        timeout=PATIENCE,
    )
    assert not {"pydantic", "numpy", "typer", "subprocess"} & set(done.stdout.split())


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"faults": "drop"}, "unknown option 'faults'; did you mean fault?"),
        ({"seed": -1}, "seed should be greater than or equal to 0"),
        ({"robots": 2}, "robots: several in one world are started with"),
        ({"speed": 0}, "speed should be greater than or equal to 0.01"),
    ],
)
def test_an_option_that_is_none_is_told_before_anything_is_started(
    options: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(EmulatorError) as caught:
        khepera_emulator.start(**options)
    assert str(caught.value).startswith(sentence)


def test_the_package_offers_nothing_else() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'stop'"):
        _ = khepera_emulator.stop


def test_what_the_emulator_refuses_is_its_own_sentence(tmp_path: Path) -> None:
    with pytest.raises(EmulatorError, match=r"^unknown arena 'moon': there are corridor,"):
        khepera_emulator.start(arena="moon", folder=tmp_path)


def test_a_file_of_the_program_under_test_is_no_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "serial.py").write_text("raise SystemExit('not this one')")
    (tmp_path / "log").mkdir()
    monkeypatch.chdir(tmp_path)
    with khepera_emulator.start(folder=Path("log")) as robot:
        monkeypatch.chdir("/")
        assert robot.wire_log == ()


def test_a_robot_that_has_died_is_told(tmp_path: Path) -> None:
    with khepera_emulator.start(folder=tmp_path) as robot:
        os.kill(robot.pid, signal.SIGKILL)
        with pytest.raises(EmulatorError, match=r"^the emulator has ended with status -9$"):
            robot.truth()
        assert robot.wire_log == ()
    with pytest.raises(EmulatorError, match="the robot is switched off"):
        robot.truth()
    assert robot.wire_log == ()


ORPHAN = """
import os, khepera_emulator, signal
robot = khepera_emulator.start()
print(robot.pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_no_robot_outlives_the_program_that_has_started_it(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", ORPHAN],
        env={**os.environ, "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
        timeout=2 * PATIENCE,
    )
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert has_ended(int(done.stdout))


def test_pieces_of_a_reply_are_shown_as_one() -> None:
    entries = [
        Entry(1.0, "request", b"B\n"),
        Entry(1.1, "reply", b"b,5"),
        Entry(1.2, "reply", b".01\r\n"),
        Entry(1.3, "reply", b"half"),
        Entry(1.4, "fault", text="reply drop: b'x'"),
        Entry(1.5, "reply", b"rest"),
    ]
    assert report(entries).splitlines() == [
        r"    1.0000 s  request  'B\n'",
        r"    1.2000 s  reply    'b,5.01\r\n'",
        "    1.3000 s  reply    'half'",
        "    1.4000 s  fault    reply drop: b'x'",
        "    1.5000 s  reply    'rest'",
    ]


def test_of_a_long_log_the_last_lines_are_shown() -> None:
    lines = report(Entry(float(k), "request", b"B\n") for k in range(1234)).splitlines()
    assert lines[0] == "(1,034 lines before)"
    assert len(lines) == 201
    assert lines[-1].startswith(" 1233.0000 s")
