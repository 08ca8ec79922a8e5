"""A disk that is full, at any byte: what is written ends and says so, and nothing else does."""

import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import serial
from as_type import not_none
from emulator_process import COMMAND, PATIENCE

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.wire_log import WireLog, read_log
from macor_hil.errors import RecordingError
from macor_hil.telemetry.recordings.recording import Recorder

RECORDING = """
import resource, sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from watching_helpers import a_life
from macor_hil.errors import RecordingError
from macor_hil.telemetry.recordings.recording import Recorder
events, hard = a_life(5), resource.getrlimit(resource.RLIMIT_FSIZE)[1]
for room in map(int, sys.argv[3:]):
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
    try:
        with Recorder(Path(sys.argv[2]), 'khepera') as recorder:
            for event in events:
                recorder.write(event)
    except RecordingError as error:
        said = str(error)
    else:
        said = 'there was room'
    resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    print(said)
"""


def test_a_recorder_names_the_error_at_every_size_of_the_disk(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    sizes = [0, 1, 7, 8, 9, 50, 100, *range(300, 6000, 331), *range(6000, 30_000, 3331)]
    done = subprocess.run(
        [sys.executable, "-c", RECORDING, str(Path(__file__).parent), str(path), *map(str, sizes)],
        capture_output=True,
        text=True,
        timeout=2 * PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    said = done.stdout.splitlines()
    assert len(said) == len(sizes)
    assert set(said) <= {f"cannot record to {path}: File too large", "there was room"}
    assert said.count("there was room") < len(sizes)


def test_a_recorder_without_any_room_says_so_at_once() -> None:
    full = Path("/dev/full")
    with (
        pytest.raises(RecordingError, match="cannot record to /dev/full: No space left"),
        Recorder(full, "khepera"),
    ):
        pass


def test_a_wire_log_without_any_room_says_so_at_once() -> None:
    with pytest.raises(EmulatorError, match="cannot record to /dev/full: No space left"):
        WireLog(Path("/dev/full"), "khepera://corridor")


def test_a_wire_log_that_is_being_written_is_left_alone(tmp_path: Path) -> None:
    with WireLog(tmp_path / "log", "khepera://corridor") as log:
        log.request(0.5, b"B\n")
        with pytest.raises(EmulatorError, match="another emulator does"):
            WireLog(tmp_path / "log", "khepera://corridor")
    assert len(read_log(tmp_path / "log").entries) == 1
    with WireLog(tmp_path / "log", "khepera://corridor"):
        pass
    assert read_log(tmp_path / "log").entries == ()


def test_a_robot_outlives_the_room_for_its_wire_log(tmp_path: Path) -> None:
    log = tmp_path / "log"

    def little_room() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))

    command = [*COMMAND, "--no-zenoh", "--record", str(log), "--baud", "unpaced"]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=little_room,
    ) as running:
        path = not_none(running.stdout).readline().rstrip("\n").partition(" on ")[2]
        with serial.Serial(path, timeout=PATIENCE) as port:
            for _ in range(50):
                port.write(b"B\n")
                assert port.readline().startswith(b"b,")
        os.kill(running.pid, signal.SIGTERM)
        _, said = running.communicate(timeout=PATIENCE)
    assert running.returncode == 0
    (told,) = [line for line in said.splitlines() if "recording" in line]
    assert f"the recording {log} ends here: File too large; the robot goes on" in told
    assert 10 < len(read_log(log).entries) < 50
