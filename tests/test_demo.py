"""The demonstration as a program: it ends in order, and others may run beside it."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from as_type import not_none
from drives import MACOR_HIL
from emulator_process import PATIENCE
from short_training import train_shortly

from macor_hil.errors import BenchError
from macor_hil.runs.demo import DemoSettings, emulator_process, reserved
from macor_hil.telemetry.session import open_session


@pytest.fixture
def settings(tmp_path: Path) -> DemoSettings:
    return DemoSettings(tmp_path / "corridor.npz")


TALKING = """#!{python}
import pathlib, signal, sys
if "run" in sys.argv:
    print("khepera on /dev/pts/77", flush=True)
    sys.stderr.write("a warning\\n" * 100_000)
    pathlib.Path({said!r}).touch()
    signal.pause()
"""


def stand_in(monkeypatch: pytest.MonkeyPatch, folder: Path, text: str, **values: str) -> None:
    """Have the demo start a script instead of its emulator."""
    script = folder / "python"
    script.write_text(text.format(python=sys.executable, **values))
    script.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(script))


def test_an_emulator_may_say_any_number_of_warnings(
    settings: DemoSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = tmp_path / "said"
    os.mkfifo(said)  # opening it waits until the emulator has said everything
    stand_in(monkeypatch, tmp_path, TALKING.replace(".touch()", ".write_text('')"), said=str(said))
    with emulator_process(settings) as port:
        assert port == "/dev/pts/77"
        assert said.read_text() == ""


def test_an_emulator_that_does_not_start_says_why(
    settings: DemoSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(monkeypatch, tmp_path, "#!{python}\nimport sys\nsys.exit('no \\x1b arena')")
    with (
        pytest.raises(BenchError, match=r"did not start: no \\x1b arena"),
        emulator_process(settings),
    ):
        pass


def test_an_endpoint_that_is_taken_is_another_one() -> None:
    with socket.socket() as usual:
        usual.bind(("127.0.0.1", 0))
        wanted = f"tcp/127.0.0.1:{usual.getsockname()[1]}"
        with reserved(wanted) as first, reserved(wanted) as second:
            assert len({wanted, first, second}) == 3
            with open_session([first], []), open_session([second], []):
                pass  # who they are reserved for can have them


def test_watchers_are_led_to_other_endpoints(tmp_path: Path) -> None:
    assert DemoSettings(tmp_path).watching == ""
    other = DemoSettings(tmp_path, emulator="tcp/127.0.0.1:1", controller="tcp/127.0.0.1:2")
    assert other.watching == " --connect tcp/127.0.0.1:2 --connect tcp/127.0.0.1:1"


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
def test_the_key_ctrl_c_ends_the_robot_before_its_emulator(
    tmp_path: Path, number: int, status: int
) -> None:
    train_shortly(tmp_path / "corridor.npz", "khepera://corridor?seed=5")
    with subprocess.Popen(
        [*MACOR_HIL, "demo", "--folder", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
    ) as running:
        lines = iter(not_none(running.stdout).readline, "")
        assert any(line.startswith("graded") for line in lines)
        os.killpg(running.pid, number)  # as the terminal does: to all who are in front
        said = running.communicate(timeout=PATIENCE)[1]
    assert running.returncode == status
    ended = "interrupted" if status else "ended by SIGTERM"
    assert said.splitlines()[-1].startswith(f"macor-hil: {ended}; the map is in")
    assert "NOT confirmed" not in said
