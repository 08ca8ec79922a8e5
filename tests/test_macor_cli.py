"""The command line of the controller, as processes: results, and errors of one sentence."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import serial
from emulator_process import emulator, free_endpoint
from khepera_protocol.zenoh.controller_payloads import Phase, State
from test_map_file import change_meta

from macor_hil.cli import program
from macor_hil.cli.ending import Status
from macor_hil.mind.map_file import VERSION
from macor_hil.telemetry.feed import Arrival, Feed
from macor_hil.telemetry.session import open_session

SHORT = ("--tuning", "20", "--random", "30", "--reactive", "10", "--nodes", "10")


def macor_hil(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "macor_hil.cli", *arguments]
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=100, check=False
    )


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trained")
    done = macor_hil("train", "--map", "a.npz", *SHORT, folder=folder)
    assert done.returncode == 0, done.stderr
    assert re.match(r"a.npz: \d+ situations, \d+ transitions from 60 commands", done.stdout)
    return folder / "a.npz"


def refusal(done: subprocess.CompletedProcess[str], status: Status = Status.FAILED) -> str:
    """The one sentence on the standard error output of a failed command."""
    assert done.returncode == status, done.stdout + done.stderr
    lines = [line for line in done.stderr.splitlines() if line.startswith("macor-hil: ")]
    assert len(lines) == 1, done.stderr
    assert "Traceback" not in done.stderr
    return lines[0]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("run", "--map", "none.npz"), "there is no map none.npz"),
        (("run", "--map", "cake.npz"), "cake.npz is not a map file"),
        (("run", "--map", "old.npz"), f"this program reads version {VERSION}"),
        (("run", "--map", "{map}", "--planner", "magic"), "no planner 'magic'"),
        (("run", "--map", "{map}", "--port", "nowhere"), "cannot open the serial port nowhere"),
        (("run", "--map", "{map}", "--port", "khepera://moon"), "unknown arena 'moon'"),
        (("run", "--map", "{map}", "--port", "http://robot"), "cannot open the serial port"),
        (("run", "--map", "{map}", "--camera", "eye"), "unknown camera 'eye'"),
        (("run", "--map", "{map}", "--camera", "video:none.mp4"), "cannot open the video source"),
        (("run", "--map", "{map}", "--listen", "here"), "an endpoint looks like"),
        (("train", "--map", "{map}"), "train it anew with --restart"),
        (("train", "--map", "b.npz", "--listen", "y"), "an endpoint looks like"),
        (("train", "--map", "b.npz", "--port", "khepera://moon"), "unknown arena 'moon'"),
        (("trials", "--map", "none.npz"), "there is no map none.npz"),
        (("look", "--camera", "port", "--port", "loop://"), "received b'B': another reply"),
    ],
)
def test_errors_are_one_sentence(
    trained: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    says: str,
) -> None:
    (tmp_path / "cake.npz").write_bytes(b"flour")
    (tmp_path / "old.npz").write_bytes(trained.read_bytes())
    change_meta(tmp_path / "old.npz", version=0)
    before = sorted(tmp_path.iterdir())
    given = [argument.replace("{map}", str(trained)) for argument in arguments]
    if given[0] == "run" and "--listen" not in given:
        given += ["--listen", free_endpoint(), "--connect", free_endpoint()]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["macor-hil", *given])
    lost = says.startswith(("cannot open the serial port nowhere", "rec"))
    assert program.run() == (Status.LOST if lost else Status.FAILED)
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith("macor-hil: ")
    assert says in said
    assert sorted(tmp_path.iterdir()) == before


def test_trials_score_both_planners(trained: Path) -> None:
    done = macor_hil("trials", "--map", str(trained), "--trials", "2", folder=trained.parent)
    assert done.returncode == 0, done.stderr
    assert "anticipative" in done.stdout
    assert "reactive" in done.stdout
    assert re.search(r"reactive +8\.0 ± 0\.0 .* 2 +0 +1[78] % +2 of 2", done.stdout)
    assert done.stdout.endswith("From every start all commands are possible.\n")
    again = macor_hil("trials", "--map", str(trained), "--trials", "2", folder=trained.parent)
    assert again.stdout == done.stdout


def test_look_draws_what_the_robot_sees(trained: Path, tmp_path: Path) -> None:
    done = macor_hil("look", "--picture", "view.png", "--map", str(trained), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    picture = cv2.imread(str(tmp_path / "view.png"))
    assert picture is not None
    assert np.ptp(picture) > 200


def test_run_drives_over_a_real_terminal_and_camera(trained: Path, tmp_path: Path) -> None:
    robot, controller = free_endpoint(), free_endpoint()
    with emulator("--listen", robot, "--baud", "unpaced", "--speed", "5") as running:
        done = macor_hil(
            *("run", "--port", running.path, "--map", str(trained), "--commands", "3"),
            *("--listen", controller, "--connect", robot),
            folder=tmp_path,
        )
    assert done.returncode == 0, done.stderr
    assert "all commands driven: 3 commands" in done.stdout


def test_a_camera_that_is_not_there_is_told(trained: Path, tmp_path: Path) -> None:
    with emulator("--no-zenoh") as running:
        done = macor_hil(
            *("run", "--port", running.path, "--map", str(trained), "--recovery", "0"),
            *("--listen", free_endpoint(), "--connect", free_endpoint()),
            folder=tmp_path,
        )
    said = refusal(done, Status.LOST)
    assert "no camera answers on the Zenoh key khepera/khepera/camera" in said


def test_a_port_in_use_is_told(tmp_path: Path) -> None:
    with emulator("--no-zenoh") as running, serial.Serial(running.path, exclusive=True):
        done = macor_hil("train", "--map", "c.npz", "--port", running.path, folder=tmp_path)
    assert "cannot open the serial port" in refusal(done, Status.LOST)
    assert list(tmp_path.iterdir()) == []


def test_a_training_can_be_watched(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    command = [sys.executable, "-m", "macor_hil.cli", "train", "--listen", endpoint]
    seen: set[str] = set()
    with (
        open_session([], [endpoint]) as session,
        Feed(session, "khepera", camera=True) as feed,
        subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL) as training,
    ):
        # a whole training: time enough for a watcher to find it
        told = None
        while training.poll() is None and not (
            told and told.driven and {"arena", "truth", "frame"} <= seen
        ):
            event = feed.get(0.1)
            if isinstance(event, Arrival):
                seen.add(event.leaf)
                if event.leaf == "state":
                    told = State.parse(event.data)
        training.kill()
    # what would draw on the robot's chance is not offered: the pictures are those it learns from
    assert seen == {"arena", "truth", "state", "frame"}
    assert told is not None
    assert (told.phase, told.limit) == (Phase.TRAINING, 13_400)
    assert 0 < told.driven < told.limit


def test_a_watched_training_learns_the_same(trained: Path) -> None:
    endpoint = free_endpoint()
    with open_session([], [endpoint]) as session, Feed(session, "khepera", camera=True):
        done = macor_hil(
            "train", "--map", "b.npz", *SHORT, "--listen", endpoint, folder=trained.parent
        )
    assert done.returncode == 0, done.stderr
    assert (trained.parent / "b.npz").read_bytes() == trained.read_bytes()


@pytest.mark.parametrize(
    ("number", "status"),
    [
        (signal.SIGINT, Status.INTERRUPTED),
        (signal.SIGTERM, Status.DONE),
        (signal.SIGHUP, Status.DONE),
    ],
)
def test_an_interrupt_that_a_library_makes_an_error_of_is_one_all_the_same(
    monkeypatch: pytest.MonkeyPatch, number: signal.Signals, status: Status
) -> None:
    def import_something() -> None:
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt:
            raise ValueError("an error of a library") from None

    monkeypatch.setattr(program, "app", import_something)
    assert program.run() == status
