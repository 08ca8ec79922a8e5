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
from khepera_protocol.options import checked, values_in
from khepera_protocol.zenoh.config import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT
from khepera_protocol.zenoh.keys import CONTROLLER_ALIVE, EMULATOR_ALIVE
from ruamel.yaml import YAML
from typer.main import get_command
from typer.testing import CliRunner

from khepera_emulator.app.cli.commands import app as emulator_app
from khepera_emulator.arenas.arena import load_arena
from macor_hil.cli.program import app as controller_app

ROOT = Path(__file__).parent.parent
DOCKERFILE = (ROOT / "docker" / "Dockerfile").read_text("utf-8").replace("\\\n", " ")
COMPOSE_TEXT = (ROOT / "docker" / "compose.yaml").read_text("utf-8")
COMPOSE = YAML(typ="safe").load(COMPOSE_TEXT)
SERVICES = COMPOSE["services"]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
HEALTH = ROOT / "docker" / "health.py"
SLIM, ADDED = (ROOT / "docker" / name for name in ("slim.sh", "added.sh"))
APPS = {"khepera-emulator": emulator_app, "macor-hil": controller_app}

STAGES = dict(
    re.findall(r"^FROM \S+ AS (\S+)\n(.*?)(?=^FROM|\Z)", DOCKERFILE, re.DOTALL | re.MULTILINE)
)
PROFILES = ("emulator", "whole", "class", "score")
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


def test_what_is_copied_is_enough_to_make_a_wheel_of(tmp_path: Path) -> None:
    for line in re.findall(r"^COPY (.*) \S+$", STAGES["build-controller"], re.MULTILINE):
        for source in line.split():
            (tmp_path / Path(source).name).symlink_to(ROOT / source)
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "from setuptools.build_meta import *; prepare_metadata_for_build_wheel('.')",
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Metadata-Version" in next(tmp_path.glob("*.dist-info/METADATA")).read_text("utf-8")


def test_images_install_extras_that_exist() -> None:
    extras = ",".join(re.findall(r"'\.\[([\w,]+)\]'", DOCKERFILE)).split(",")
    assert set(extras) <= set(PROJECT["optional-dependencies"])
    assert re.findall(r"'\.\[(.*?)\]'", STAGES["build-controller"]) == ["metrics"]


@pytest.mark.parametrize("image", IMAGES)
def test_all_images_begin_with_the_layers_of_the_controller(image: str) -> None:
    (parent,) = re.findall(rf"^FROM (\S+) AS {image}$", DOCKERFILE, re.MULTILINE)
    assert parent == ("base" if image == "controller" else "controller")


def test_what_nobody_imports_is_taken_out_of_an_installation(tmp_path: Path) -> None:
    packages = tmp_path / "lib" / "python3.11" / "site-packages"
    kept = ("numpy/linalg/linalg.py", "mine/tests/data.py", "numpy.libs/a.so", "numpy/b.so")
    gone = ("numpy/linalg/tests/a.py", "numpy/_core/include/a.h", "mine/a.pyi", "pybullet_data/a")
    for name in (*kept, *gone):
        (packages / name).parent.mkdir(parents=True, exist_ok=True)
        (packages / name).touch()
    subprocess.run([SLIM, tmp_path], check=True, timeout=PATIENCE)
    left = {str(path.relative_to(packages)) for path in packages.rglob("*") if path.is_file()}
    assert left == set(kept)


def test_a_layer_holds_what_an_installation_has_added(tmp_path: Path) -> None:
    packages = tmp_path / "opt" / "lib" / "site-packages"
    (packages / "numpy").mkdir(parents=True)
    (packages / "there.py").touch()
    more, target = packages / "more.py", tmp_path / "added"
    command = [str(ADDED), str(tmp_path / "opt"), str(target), "touch", str(more)]
    command.append(str(packages / "stub.pyi"))
    subprocess.run(command, check=True, timeout=PATIENCE, capture_output=True)
    assert [path for path in target.rglob("*") if path.is_file()] == [
        target / more.relative_to("/")
    ]


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


@pytest.mark.parametrize("name", list(SERVICES))
def test_variables_of_a_service_are_options_with_values_that_fit(name: str) -> None:
    given = {k: defaults(v) for k, v in SERVICES[name].get("environment", {}).items()}
    values: dict[str, dict[str, str]] = {program: {} for program in APPS}
    for variable, value in given.items():
        program = next(p for p in APPS if variable.startswith(prefix(p)))
        values[program][variable.removeprefix(prefix(program)).replace("_", "-").lower()] = value
    for program, options in values.items():
        command: Any = get_command(APPS[program])
        run = command.commands["run"]
        fields = values_in(options, run)
        for model in run.callback.models:
            checked(model, fields, str)
        assert fields == {}


def prefix(program: str) -> str:
    return f"{program.replace('-', '_').upper()}_RUN_"


def profiles(name: str) -> list[str]:
    found: list[str] = SERVICES[name]["profiles"]
    return found


def test_profiles_hold_what_they_are_for() -> None:
    of = {profile: {name for name in SERVICES if profile in profiles(name)} for profile in PROFILES}
    assert of["emulator"] == {"emulator"}
    assert of["whole"] == {"emulator", "train", "controller", "dashboard", "ros2"}
    assert of["class"] == {"class", "dashboard"}
    assert (ROOT / "docker" / ".env").read_text("utf-8") == "COMPOSE_PROFILES=whole\n"


def test_services_of_a_profile_need_no_service_of_another() -> None:
    for name, service in SERVICES.items():
        for other in service.get("depends_on", ()):
            assert set(profiles(name)) <= set(profiles(other))


def test_the_compose_file_keeps_to_its_specification() -> None:
    checker = ROOT / ".venv-release" / "bin" / "check-jsonschema"
    if not checker.exists():
        pytest.skip("check-jsonschema is not installed; `make docs` installs it")
    compose = str(ROOT / "docker" / "compose.yaml")
    command = [str(checker), "--builtin-schema", "vendor.compose-spec", compose]
    subprocess.run(command, check=True, timeout=PATIENCE, capture_output=True)


def test_the_arena_of_a_class_has_room_for_it() -> None:
    served = SERVICES["class"]["environment"]
    arena = load_arena(str(ROOT / "examples" / "classroom" / "arena.toml"))
    assert 1 + len(arena.starts) == int(defaults(served["KHEPERA_EMULATOR_RUN_ROBOTS"]))


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
