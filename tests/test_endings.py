"""Endings of the commands of `macor-hil`: statuses, what is said, what is left behind."""

import os
import re
import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from drives import MACOR_HIL, STATUSES, WAYS_OUT, Drive
from emulator_process import PATIENCE, emulator, free_endpoint
from interrupting import signal_after
from made_once import made_once
from rig import Closing
from short_training import train_shortly

from macor_hil.cli import program
from macor_hil.cli.ending import SUMMARY, Status
from macor_hil.errors import MacorError
from macor_hil.files import write_atomically
from macor_hil.safety.claim import claim, lock_of
from macor_hil.safety.interruption import Interruption

ENDS = [(signal.SIGINT, 130), (signal.SIGTERM, 0), (signal.SIGHUP, 0)]
DOCS = Path(__file__).parent.parent / "docs"


def macor_hil(*arguments: str, folder: Path, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*MACOR_HIL, *arguments],
        cwd=folder,
        timeout=2 * PATIENCE,
        check=False,
        **{"capture_output": True, "text": True, **options},
    )


@pytest.fixture(scope="module")
def map_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def train(folder: Path) -> None:
        train_shortly(folder / "short.npz")

    return made_once(tmp_path_factory, "map-of-a-box", train) / "short.npz"


LONG = {
    "train": (["train", "--map", "a"], ".a.macor-hil-lock", "nothing is kept"),
    "calibrate": (["calibrate", "--profile", "a", "--runs", "100"], "a.part", "moves are kept"),
    "record": (["record", "a", "--connect", "{endpoint}"], "a", r"interrupted$|ended by SIG\w+$"),
}
"""Commands that take long, a file that tells that they are at it, and what they say of theirs."""


@pytest.mark.parametrize(("number", "status"), ENDS)
@pytest.mark.parametrize("command", LONG)
def test_a_signal_has_its_status_and_says_what_was_kept(
    tmp_path: Path, command: str, number: signal.Signals, status: int
) -> None:
    arguments, file, says = LONG[command]
    given = [each.format(endpoint=free_endpoint()) for each in arguments]
    with subprocess.Popen(
        [*MACOR_HIL, *given],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as running:
        wait_for(tmp_path / file)
        running.send_signal(number)
        said = running.communicate(timeout=PATIENCE)[1]
    assert running.returncode == status, said
    assert "Traceback" not in said
    last = said.splitlines()[-1]
    assert last.startswith(f"macor-hil: {'interrupted' if status else 'ended by SIG'}")
    assert re.search(says, last)
    assert not lock_of(tmp_path / "a").exists()


def wait_for(path: Path) -> None:
    """Return when a file is there; a folder tells of it."""
    end = threading.Event()
    for _ in range(round(PATIENCE / 0.01)):
        if path.exists():
            return
        end.wait(0.01)
    raise AssertionError(f"{path} does not come")


@pytest.fixture
def on_a_terminal() -> Iterator[Callable[..., Any]]:
    """Start a command on a terminal of its own."""
    started: list[Closing] = []
    yield lambda *arguments, **popen: Drive(started, [*MACOR_HIL, *arguments], **popen)
    for drive in started:
        drive.close()


@pytest.mark.parametrize("way", WAYS_OUT)
def test_a_prompt_ends_as_everything_does(
    on_a_terminal: Callable[..., Any], tmp_path: Path, way: str
) -> None:
    with emulator("--no-zenoh") as robot:
        command = ("calibrate", "--port", robot.path, "--profile", str(tmp_path / "p"))
        asked = on_a_terminal(*command)
        asked.wait_for(b"stands there: ")
        WAYS_OUT[way](asked)
        assert asked.wait() == STATUSES[way]
    assert b"Abort" not in asked.said
    assert way == "terminal closed" or b"no move was measured" in asked.said


def test_the_key_ctrl_c_at_a_prompt(on_a_terminal: Callable[..., Any], tmp_path: Path) -> None:
    with emulator("--no-zenoh") as robot:
        asked = on_a_terminal("calibrate", "--port", robot.path, "--profile", str(tmp_path / "p"))
        asked.wait_for(b"stands there: ")
        asked.answer(b"\x03")
        assert asked.wait() == Status.INTERRUPTED
    assert b"Traceback" not in asked.said


def test_what_hands_have_measured_is_kept(
    on_a_terminal: Callable[..., Any], tmp_path: Path
) -> None:
    command = ("calibrate", "--profile", str(tmp_path / "p"), "--side", "0.05", "--runs", "1")
    with emulator("--no-zenoh", "--speed", "20", "--baud", "unpaced", "--drift", "none") as robot:
        asked = on_a_terminal(*command, "--port", robot.path)
        asked.wait_for(b"straight, run 1")
        asked.answer(b"\n")
        asked.wait_for(b"X Y [TURN]: ")
        asked.answer(b"nan 0\n")
        asked.wait_for(b"finite numbers")
        asked.answer(b"-500 0\n")
        asked.wait_for(b"mm from where the move leads")
        asked.answer(b"50 0\n")
        asked.wait_for(b"square clockwise, run 1")
        asked.signal(signal.SIGINT)
        assert asked.wait() == Status.INTERRUPTED
        assert b"1 of 5 moves are kept in" in asked.said
        again = on_a_terminal(*command, "--port", robot.path)
        again.wait_for(b"square clockwise, run 1")
        again.signal(signal.SIGTERM)
        assert again.wait() == Status.DONE
        other = macor_hil(*command, "--port", robot.path, "--speed", "5", folder=tmp_path)
    assert "of another course" in other.stderr
    assert "--restart" in other.stderr


def test_a_prompt_that_nobody_can_answer_is_an_error(tmp_path: Path) -> None:
    with emulator("--no-zenoh") as robot:
        done = macor_hil(
            *("calibrate", "--port", robot.path, "--profile", "p"),
            folder=tmp_path,
            stdin=subprocess.DEVNULL,
        )
    assert done.returncode == Status.FAILED
    assert "the standard input ended" in done.stderr


def test_a_collision_has_a_status_of_its_own(map_file: Path, tmp_path: Path) -> None:
    run = ("run", "--map", str(map_file), "--planner", "reactive", "--commands", "500")
    done = macor_hil(
        *run, "--listen", free_endpoint(), "--port", "khepera://corridor?seed=1", folder=tmp_path
    )
    assert done.returncode == Status.COLLISION
    assert done.stdout.splitlines()[-1].startswith("collision: ")


IMPORTING = """
import signal, sys, weakref
def come(*_):
    signal.raise_signal({number})
class Interrupt:
    def find_spec(self, name, *rest):
        if name == "numpy":
            {happens}
sys.meta_path.insert(0, Interrupt())
sys.argv = ["macor-hil", "keys"]
from macor_hil.cli import main
main()
"""


@pytest.mark.parametrize(
    "happens", ["come()", "gone = Interrupt(); seen = weakref.ref(gone, come); del gone"]
)
@pytest.mark.parametrize(("number", "status"), ENDS)
def test_a_signal_while_the_program_is_being_imported_is_no_traceback(
    number: signal.Signals, status: int, happens: str
) -> None:
    code = IMPORTING.format(number=int(number), happens=happens)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.returncode == status
    # commands are imported when the program runs already, and tells what ended it
    assert done.stderr == f"macor-hil: {'interrupted' if status else f'ended by {number.name}'}\n"


@pytest.mark.parametrize("closed", ["0<&-", "1>&-", "2>&-", "0<&- 1>&- 2>&-"])
def test_standard_files_may_be_closed(tmp_path: Path, closed: str) -> None:
    command = f'"{sys.executable}" -m macor_hil.cli look --picture a.png {closed}'
    done = subprocess.run(["sh", "-c", command], cwd=tmp_path, timeout=PATIENCE, check=False)
    assert done.returncode == 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_an_output_without_room_is_one_sentence(tmp_path: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = macor_hil(
            "keys", folder=tmp_path, capture_output=False, stdout=full, stderr=subprocess.PIPE
        )
    assert done.returncode == Status.FAILED
    assert done.stderr == "macor-hil: cannot go on: No space left on device\n"


def test_an_output_that_nobody_reads_is_one_sentence(tmp_path: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    done = macor_hil(
        "keys", folder=tmp_path, capture_output=False, stdout=write, stderr=subprocess.PIPE
    )
    os.close(write)
    assert done.returncode == Status.FAILED
    assert done.stderr == "macor-hil: nobody reads the standard output\n"


def thousand_descriptors() -> None:
    """Leave more open than `select` has a place for."""
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 4096), hard))
    null = os.open(os.devnull, os.O_RDONLY)
    for _ in range(1100):
        os.set_inheritable(os.dup(null), True)


@pytest.mark.parametrize("options", [(), ("--tcp", "127.0.0.1:0"), ("--rfc2217", "127.0.0.1:0")])
def test_a_thousand_inherited_descriptors_are_no_hindrance(
    tmp_path: Path, options: tuple[str, ...]
) -> None:
    few = {"close_fds": False, "preexec_fn": thousand_descriptors}
    with emulator("--baud", "unpaced", "--no-zenoh", *options, **few) as robot:
        done = macor_hil(
            *("calibrate", "--port", robot.path, "--profile", "p"),
            folder=tmp_path,
            stdin=subprocess.DEVNULL,
            **few,
        )
    assert "the standard input ended" in done.stderr  # the robot has answered, and a hand is needed


def test_an_interrupt_within_an_atomic_write_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("fsync", "replace"):

        def interrupted(*_: int | Path) -> None:
            raise KeyboardInterrupt

        target = os if name == "fsync" else Path
        with monkeypatch.context() as patch:
            patch.setattr(target, name, interrupted)
            with pytest.raises(KeyboardInterrupt):
                write_atomically(tmp_path / "a", b"new")
    assert list(tmp_path.iterdir()) == []


def test_one_program_at_a_time_works_on_a_file(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "a"
    with (
        claim(path),
        pytest.raises(MacorError, match=r"another program is writing .*/a; wait for its end"),
        claim(path),
    ):
        pass
    with claim(path):
        assert lock_of(path).exists()
    assert list(path.parent.iterdir()) == []


def test_a_lock_that_a_kill_has_left_behind_holds_nobody(tmp_path: Path) -> None:
    with claim(tmp_path / "a"):
        left = lock_of(tmp_path / "a").read_bytes()
    lock_of(tmp_path / "a").write_bytes(left)
    with claim(tmp_path / "a"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_file_of_somebody_elses_is_not_taken_for_a_lock(tmp_path: Path) -> None:
    lock_of(tmp_path / "a").write_bytes(b"mine")
    with pytest.raises(MacorError, match="is none; move it away"), claim(tmp_path / "a"):
        pass
    assert lock_of(tmp_path / "a").read_bytes() == b"mine"


def test_a_pipe_where_a_lock_belongs_does_not_make_it_wait(tmp_path: Path) -> None:
    pipe = lock_of(tmp_path / "a")
    os.mkfifo(pipe)
    before = pipe.lstat()
    with pytest.raises(MacorError, match="is none; move it away"), claim(tmp_path / "a"):
        pass
    assert os.path.samestat(pipe.lstat(), before)


def test_a_claim_leaves_nothing_behind_wherever_in_its_taking_a_signal_comes(
    tmp_path: Path,
) -> None:
    file, calls, came = tmp_path / "a", 0, [True]
    while came:
        calls, came = calls + 1, []
        with Interruption(), suppress(KeyboardInterrupt):
            try:
                sys.setprofile(signal_after(calls, came))
                with claim(file):
                    sys.setprofile(None)
            finally:
                sys.setprofile(None)
        assert not lock_of(file).exists(), f"left behind by a signal after call {calls}"
    assert calls > 10


def test_two_trainings_of_one_map_do_not_both_report_success(tmp_path: Path) -> None:
    with claim(tmp_path / "a.npz"):
        done = macor_hil("train", "--map", "a.npz", "--tuning", "10", folder=tmp_path)
    assert done.returncode == Status.FAILED
    assert "another program is writing a.npz" in done.stderr


BAD_PATHS = {
    "/": "is a folder",
    ".": "is a folder",
    "": "is a folder",
    "x" * 300: "a name of 300 bytes is too long",
    "file/x.png": "file is no folder",
    "/proc/x.png": "cannot be written: /proc: ",
    "pipe": "is no ordinary file",
}


@pytest.mark.parametrize(("path", "says"), BAD_PATHS.items())
@pytest.mark.parametrize(
    "command",
    [
        ("train", "--map"),
        ("look", "--picture"),
        ("camera", "--picture"),
        ("camera", "--calibrate", "--profile"),
        ("calibrate", "--profile"),
        ("record",),
        ("learn", "nothing.mcap", "--map"),
    ],
    ids=" ".join,
)
def test_a_file_that_cannot_be_written_is_refused_before_work_begins(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    command: tuple[str, ...],
    path: str,
    says: str,
) -> None:
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "pipe")
    refuse([*command, path], says, tmp_path, monkeypatch, capfd)


@pytest.mark.parametrize("command", [("demo", "--folder"), ("reproduce", "table1", "--out")])
@pytest.mark.parametrize(
    ("path", "says"),
    [("/", "is the root folder"), ("file", "file is no folder"), ("x" * 300, "is too long")],
)
def test_a_folder_that_cannot_be_written_is_refused_before_work_begins(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    command: tuple[str, ...],
    path: str,
    says: str,
) -> None:
    (tmp_path / "file").touch()
    refuse([*command, path], says, tmp_path, monkeypatch, capfd)


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (("look", "--picture", "x.jpg"), "must end with .png"),
        (("camera", "--picture", "x"), "must end with .png"),
        (("camera", "--centre", "1,2"), "for --calibrate, which is not there"),
        (("camera", "--inner", "1"), "for --calibrate, which is not there"),
        (("trials", "--map", "{map}", "--planner", "mine"), "there is no planner 'mine'"),
        (("look", "--profile", "none.json"), "macor-hil camera --calibrate --profile none.json"),
    ],
)
def test_what_cannot_be_is_refused_before_work_begins(
    map_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    command: tuple[str, ...],
    says: str,
) -> None:
    given = [each.format(map=map_file) for each in command]
    refuse(given, says, tmp_path, monkeypatch, capfd)


def refuse(
    arguments: list[str],
    says: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """See that a command is refused in one sentence, at once, and writes nothing."""

    def opened(*_: object, **__: object) -> None:
        raise AssertionError("work has begun")

    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", ["macor-hil", *arguments])
    monkeypatch.setattr("macor_hil.hardware.devices.open_port", opened)
    before = sorted(folder.iterdir())
    assert program.run() == Status.FAILED
    (said,) = capfd.readouterr().err.splitlines()
    assert said.startswith("macor-hil: ")
    assert re.search(says, said)
    assert sorted(folder.iterdir()) == before


def test_a_camera_of_a_wrong_size_fails_at_once_with_the_same_hint(
    map_file: Path, tmp_path: Path
) -> None:
    (tmp_path / "small").mkdir()
    for number in range(3):
        cv2.imwrite(str(tmp_path / "small" / f"{number}.png"), np.full((80, 80, 3), 99, np.uint8))
    camera = ("--camera", "images:small", "--port", "khepera://open-box?seed=1")
    for_ever = ("--recovery", "inf", "--wait", "inf", "--listen", free_endpoint())
    run = macor_hil("run", "--map", str(map_file), *camera, *for_ever, folder=tmp_path)
    look = macor_hil("look", "--picture", "a.png", *camera, folder=tmp_path)
    train = macor_hil("train", "--map", "a", "--recovery", "back", *camera, folder=tmp_path)
    assert {run.returncode, look.returncode, train.returncode} == {Status.FAILED}
    hints = {done.stderr.splitlines()[-1].partition("picture")[2] for done in (run, look, train)}
    (hint,) = hints
    assert "macor-hil camera --calibrate" in hint


def test_a_robots_wrong_name_fails_at_once(map_file: Path, tmp_path: Path) -> None:
    with emulator("--listen", (endpoint := free_endpoint()), "--baud", "unpaced") as robot:
        done = macor_hil(
            *("run", "--port", robot.path, "--map", str(map_file), "--robot", "other"),
            *("--recovery", "inf", "--wait", "inf", "--listen", free_endpoint()),
            *("--connect", endpoint),
            folder=tmp_path,
        )
    assert done.returncode == Status.FAILED
    assert "no camera answers on the Zenoh key khepera/other/camera" in done.stderr
    assert "there are the robots khepera" in done.stderr


def test_a_robot_that_is_not_there_has_a_status_of_its_own(map_file: Path, tmp_path: Path) -> None:
    run = ("run", "--map", str(map_file), "--port", str(tmp_path / "none"))
    done = macor_hil(*run, "--listen", free_endpoint(), folder=tmp_path)
    assert done.returncode == Status.LOST
    (said,) = done.stderr.splitlines()
    assert said.startswith("macor-hil: cannot open the serial port")


def test_a_robot_that_is_waited_for_and_does_not_come_is_lost(
    map_file: Path, tmp_path: Path
) -> None:
    run = ("run", "--map", str(map_file), "--port", str(tmp_path / "none"), "--wait", "0.1")
    done = macor_hil(*run, "--listen", free_endpoint(), folder=tmp_path)
    assert done.returncode == Status.LOST
    assert "WARNING macor_hil.runs.run_reporter: waiting: cannot open" in done.stderr


def test_the_statuses_are_documented() -> None:
    page = (DOCS / "exit-status.md").read_text("utf-8")
    documented = re.findall(r"^\| (\d+) \|", page, re.MULTILINE)
    assert documented == [str(int(status)) for status in Status]
    assert re.findall(r"\b\d+\b", SUMMARY) == documented


def test_an_interrupt_that_hit_the_making_of_code_does_not_end_the_process_by_it(
    tmp_path: Path,
) -> None:
    (tmp_path / "program.py").write_text(
        "import sys\n"
        "from khepera_protocol.system.startup import ignore_signals\n"
        "try:\n"
        "    exec('raise KeyboardInterrupt')  # as dataclasses make their methods\n"
        "except KeyboardInterrupt:\n"
        "    ignore_signals()\n"
        "sys.exit(0)\n"
    )
    command = [sys.executable, "-m", "program"]
    assert subprocess.run(command, cwd=tmp_path, timeout=PATIENCE, check=False).returncode == 0
