"""Images and compose file in step with the project; no engine is needed (see docs/docker.md)."""

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from emulator_process import PATIENCE, emulator, free_endpoint
from khepera_protocol.zenoh.config import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT
from khepera_protocol.zenoh.keys import CONTROLLER_ALIVE, EMULATOR_ALIVE
from ruamel.yaml import YAML
from typer.testing import CliRunner

from khepera_emulator.app.cli.commands import app as emulator_app
from macor_hil.cli.program import app as controller_app

ROOT = Path(__file__).parent.parent
DOCKERFILE = (ROOT / "docker" / "Dockerfile").read_text("utf-8").replace("\\\n", " ")
COMPOSE_TEXT = (ROOT / "docker" / "compose.yaml").read_text("utf-8")
COMPOSE = YAML(typ="safe").load(COMPOSE_TEXT)
SERVICES = COMPOSE["services"]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
HEALTH = ROOT / "docker" / "health.py"
APPS = {"khepera-emulator": emulator_app, "macor-hil": controller_app}

STAGES = dict(
    re.findall(r"^FROM \S+ AS (\S+)\n(.*?)(?=^FROM|\Z)", DOCKERFILE, re.DOTALL | re.MULTILINE)
)
IMAGES = ("emulator", "controller", "monitors")


def instruction(stage: str, name: str) -> str:
    """The last instruction of a kind in a stage."""
    found: list[str] = re.findall(rf"^{name} (.*)$", STAGES[stage], re.MULTILINE)
    return found[-1].strip()


def words(text: str) -> Any:
    return YAML(typ="safe").load(text)


def is_command(program: str, arguments: list[str]) -> bool:
    """Return whether a program takes such arguments: unknown options are errors, not help."""
    return CliRunner().invoke(APPS[program], [*arguments, "--help"]).exit_code == 0


def test_the_base_is_the_reference_python() -> None:
    (base,) = re.findall(r"^FROM (python:\S+) AS base", DOCKERFILE, re.MULTILINE)
    assert base.removeprefix("python:").partition("-")[0] == PROJECT["requires-python"][2:]


def test_what_is_copied_is_there_and_sent_to_the_engine() -> None:
    ignore = (ROOT / ".dockerignore").read_text("utf-8").splitlines()
    for line in re.findall(r"^COPY (?!--from)(.*) \S+$", DOCKERFILE, re.MULTILINE):
        for source in line.split():
            assert (ROOT / source).exists()
            assert f"!{source}" in ignore


def test_images_install_extras_that_exist() -> None:
    extras = ",".join(re.findall(r"'\.\[([\w,]+)\]'", DOCKERFILE)).split(",")
    assert set(extras) <= set(PROJECT["optional-dependencies"])
    assert "'.[" not in STAGES["build-controller"]


@pytest.mark.parametrize("image", IMAGES)
def test_an_image_has_no_rights_and_stops_by_a_signal_that_stops_the_robot(image: str) -> None:
    assert instruction(image, "USER") == "khepera"
    assert instruction(image, "STOPSIGNAL") == "SIGTERM"
    (program,) = words(instruction(image, "ENTRYPOINT"))
    assert program in PROJECT["scripts"]
    assert is_command(program, words(instruction(image, "CMD")))


@pytest.mark.parametrize(
    ("image", "endpoint", "key"),
    [
        ("emulator", DEFAULT_ENDPOINT, EMULATOR_ALIVE.of("*")),
        ("controller", CONTROLLER_ENDPOINT, CONTROLLER_ALIVE.of("*")),
    ],
)
def test_health_is_asked_where_the_program_listens(image: str, endpoint: str, key: str) -> None:
    check = instruction(image, "HEALTHCHECK").partition("CMD ")[2]
    assert words(check) == ["python", "/opt/khepera/bin/health.py", endpoint, key]


def test_health_is_that_of_the_robot() -> None:
    endpoint = free_endpoint()
    command = [sys.executable, str(HEALTH), endpoint, EMULATOR_ALIVE.of("*")]
    with emulator("--listen", endpoint):
        assert subprocess.run(command, timeout=PATIENCE, check=False).returncode == 0
    assert subprocess.run(command, timeout=PATIENCE, check=False).returncode == 1


@pytest.mark.parametrize("name", list(SERVICES))
def test_a_service_is_of_this_version_and_has_no_rights(name: str) -> None:
    service = SERVICES[name]
    target, _, version = service["image"].removeprefix("khepera-macor/").partition(":")
    assert target in IMAGES
    assert version == PROJECT["version"]
    if "build" in service:
        build = service["build"]
        assert build["target"] == target
        assert (ROOT / "docker" / build["context"] / build["dockerfile"]).is_file()
    assert service["read_only"]
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert service["network_mode"] == "host"


def defaults(text: str) -> str:
    """A command with its variables' defaults in."""
    return re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", text)


@pytest.mark.parametrize("name", list(SERVICES))
def test_a_service_runs_a_command_that_there_is(name: str) -> None:
    service = SERVICES[name]
    if "entrypoint" in service:
        script = service["entrypoint"][-1]
        program, *arguments = shlex.split(script.partition("exec ")[2])
    else:
        image = service["image"].removeprefix("khepera-macor/").partition(":")[0]
        (program,) = words(instruction(image, "ENTRYPOINT"))
        arguments = [defaults(word) for word in service["command"]]
    assert is_command(program, arguments)


def test_the_controller_drives_the_line_that_the_emulator_serves() -> None:
    served = SERVICES["emulator"]["command"]
    address = served[served.index("--rfc2217") + 1]
    assert f"--port=rfc2217://{address}" in map(defaults, SERVICES["controller"]["command"])


def test_nobody_but_this_machine_reaches_it() -> None:
    assert "0.0.0.0" not in COMPOSE_TEXT + DOCKERFILE
    assert "--expose" not in COMPOSE_TEXT + DOCKERFILE


def test_a_physical_robot_is_one_line_away() -> None:
    (line,) = re.findall(r"^ +# (devices: .*?) # ", COMPOSE_TEXT, re.MULTILINE)
    assert words(line) == {"devices": ["/dev/ttyUSB0", "/dev/video0"]}
