"""Imports of the command line: a list of commands imports none, and no library that takes long."""

import subprocess
import sys
from typing import Any

import pytest
from typer.main import get_command

from macor_hil.cli.program import app

HEAVY = {"numpy", "cv2", "zenoh", "pydantic", "serial", "pybullet", "numba", "matplotlib"}

IMPORTED = """
import sys
from macor_hil.cli.program import run
sys.argv = ["macor-hil", *sys.argv[1:]]
status = run()
print("\\n" + " ".join(sys.modules))
sys.exit(status)
"""


def imported(*arguments: str) -> set[str]:
    """Modules that are imported once a command has said its help."""
    done = subprocess.run(
        [sys.executable, "-c", IMPORTED, *arguments], capture_output=True, text=True, check=True
    )
    return set(done.stdout.splitlines()[-1].split())


def test_a_list_of_all_commands_imports_none_of_them() -> None:
    modules = imported("--help")
    assert not modules & HEAVY
    assert not {each for each in modules if each.startswith("macor_hil.cli.")} - {
        "macor_hil.cli.ending",
        "macor_hil.cli.program",
    }


@pytest.mark.parametrize(
    ("command", "other"),
    [("monitor", "macor_hil.cli.driving"), ("reproduce", "matplotlib"), ("run", "matplotlib")],
)
def test_a_command_imports_no_other_one(command: str, other: str) -> None:
    assert other not in imported(command, "--help")


def test_commands_are_described_as_they_describe_themselves() -> None:
    program: Any = get_command(app)
    told = program.commands.told
    assert list(told) == list(program.commands)
    for name, (_, text) in told.items():
        command = program.commands[name]
        assert command.name == name
        assert command.help.splitlines()[0] == text.splitlines()[0]
