"""Units, files of options and the supervisor's example in `docs/service`, taken as by a user."""

import re
import shlex
import shutil
import subprocess
import sys
from configparser import ConfigParser, RawConfigParser
from pathlib import Path
from typing import Any

import pytest
from emulator_process import PATIENCE
from khepera_protocol.config_file import check_file, commands_of
from typer.main import get_command
from typer.testing import CliRunner

from khepera_emulator.app.cli.commands import app as emulator
from macor_hil.cli.ending import Status
from macor_hil.cli.program import app as controller

FOLDER = Path(__file__).parent.parent / "docs" / "service"
APPS = {"khepera-emulator": emulator, "macor-hil": controller}
UNITS = sorted(FOLDER.glob("*.service"))
OPTIONS = {"khepera-emulator.toml": "khepera-emulator", "khepera.toml": "macor-hil"}


def read(unit: Path) -> RawConfigParser:
    class Lists(dict[str, Any]):
        """Keys may stand several times."""

        def __setitem__(self, key: str, value: Any) -> None:
            if key in self and isinstance(value, list):
                value = [*self[key], *value]
            super().__setitem__(key, value)

    parser = RawConfigParser(strict=False, dict_type=Lists, interpolation=None)
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    parser.read_string(unit.read_text("utf-8"))
    return parser


def is_command(line: str) -> bool:
    program, *arguments = shlex.split(line)
    found = CliRunner().invoke(APPS[Path(program).name], [*arguments, "--help"])
    return found.exit_code == 0


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_a_unit_starts_a_program_that_says_when_it_is_ready(unit: Path) -> None:
    service = read(unit)["Service"]
    line = service["ExecStart"].replace("%i", "khepera")
    assert is_command(line.replace("/etc/khepera-macor", str(FOLDER)))
    assert service["Type"] == "notify"
    assert float(service["WatchdogSec"]) > 20  # a video device takes 10 s to be given up
    assert service["User"] == "khepera"


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_what_is_refused_is_not_tried_again(unit: Path) -> None:
    service = read(unit)["Service"]
    never = set(map(int, service["RestartPreventExitStatus"].split()))
    assert service["Restart"] == "on-failure"
    assert Status.FAILED in never
    assert Status.LOST not in never


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_systemd_accepts_a_unit(unit: Path, tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd is not installed")
    # the programs are where they are installed
    text = re.sub(r"/opt/khepera-macor/bin/\S+", sys.executable, unit.read_text("utf-8"))
    placed = tmp_path / unit.name.replace("@", "@khepera")
    placed.write_text(text)
    command = ["systemd-analyze", "verify", "--man=no", str(placed)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(("name", "program"), OPTIONS.items())
def test_the_files_of_options_can_be_used(name: str, program: str) -> None:
    command: Any = get_command(APPS[program])
    with command.make_context(program, ["config"]) as context:
        assert set(check_file(FOLDER / name, commands_of(context), "run")) == {"run"}


def test_the_robot_of_the_one_is_the_port_of_the_other() -> None:
    emulated, driven = ((FOLDER / name).read_text("utf-8") for name in OPTIONS)
    (link,) = re.findall(r'^link = "(.*)"$', emulated, re.MULTILINE)
    assert f'port = "{link}"' in driven


def test_the_supervisors_example_starts_ten_of_each() -> None:
    parser = ConfigParser(interpolation=None)
    parser.read(FOLDER / "supervisord.conf")
    controllers, robots = parser["program:controller"], parser["program:emulator"]
    assert controllers["numprocs"] == "10"
    assert "--robots 10" in robots["command"]
    for program in (controllers, robots):
        line = program["command"].replace("%(process_num)02d", "01")
        assert is_command(re.sub(r"%\(\w+\)[sd]", "1", line))
        assert program["exitcodes"] == f"{Status.DONE:d},{Status.FAILED:d}"
