"""Packaging: the wheel holds all of the packages, and works without its extras."""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Iterator
from email import message_from_bytes
from importlib import import_module
from pathlib import Path

import pytest
import pythons
from as_type import not_none
from emulator_process import PATIENCE
from packaging.requirements import Requirement

from khepera_emulator.world.bullet import WHEELS

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
PACKAGES = ("protocol", "khepera_emulator", "macor_hil")

NEEDS = {
    "artlib": "peers",
    "distributed": "cluster",
    "foxglove": "foxglove",
    "foxglove_schemas_protobuf": "recording",
    "gymnasium": "gymnasium",
    "joblib": "experiments",
    "lz4": "recording",
    "matplotlib": "pictures",
    "mcap": "recording",
    "mcap_protobuf": "recording",
    "starlette": "dashboard",
    "uvicorn": "dashboard",
    "websockets": "dashboard",
    "numba": "compiled",
    "pandas": "analysis",
    "prometheus_client": "metrics",
    "pybullet": "emulator",
    "rosbags": "ros",
    "xxhash": "ros",
    "zstandard": "recording",
}
"""Importable names of what only an extra brings."""

IGNORED = shutil.ignore_patterns("__pycache__")

NOT_THE_PROJECT = shutil.ignore_patterns(
    *(".git", ".venv*", ".*_cache", ".hypothesis", "*.egg-info", "__pycache__"),
    *("build", "dist", "runs"),
)

OF_THE_SOURCES = (
    "tests/test_protocol_framing.py",
    "tests/test_motors.py",
    "tests/test_fuzzy_art.py",
)
"""Quick tests, one of each package, that an unpacked source distribution runs."""

MAY_FAIL = {
    "macor_hil.environment": "gymnasium",
    "macor_hil.experiments": "experiments",
    "macor_hil.mind.eyes.panorama_scan": "compiled",
    "macor_hil.mind.foresight.compiled_floor": "compiled",
    "macor_hil.monitor.dashboard": "dashboard",
    "macor_hil.telemetry.ros2": "ros",
    "macor_hil.runs.by_hand.ros_drive": "ros",
    "macor_hil.telemetry.viewers.live": "foxglove",
    "macor_hil.telemetry.viewers.scene": "recording",
    "macor_hil.telemetry.viewers.topics": "recording",
    "macor_hil.telemetry.recordings.mcap_file": "recording",
    "macor_hil.telemetry.recordings.mcap_index": "recording",
    "macor_hil.telemetry.recordings.recorder": "recording",
    "macor_hil.telemetry.recordings.recording": "recording",
}


def without_extras(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python code where nothing can be imported that only an extra brings."""
    block = f"import sys; sys.modules.update(dict.fromkeys({list(NEEDS)}));"
    return subprocess.run(
        [sys.executable, "-c", block + code, *arguments],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


def modules(package: str) -> Iterator[str]:
    for file in sorted((ROOT / package).rglob("*.py")):
        parts = file.relative_to(ROOT).with_suffix("").parts
        if parts[-1] != "__main__":
            yield ".".join(part for part in parts if part != "__init__")


def test_the_wheel_holds_every_file_of_the_packages(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    for file in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / file, source)
    for package in PACKAGES:
        shutil.copytree(ROOT / package, source / package, ignore=IGNORED)
    files = {
        str(file.relative_to(source)).removeprefix("protocol/")
        for package in PACKAGES
        for file in (source / package).rglob("*")
        if file.is_file()
    }
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-index"]
    command += ["--no-build-isolation", "--wheel-dir", str(tmp_path), str(source)]
    subprocess.run(command, check=True, timeout=PATIENCE, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    inside = zipfile.ZipFile(wheel)
    assert files <= set(inside.namelist())
    (metadata,) = [name for name in inside.namelist() if name.endswith("/METADATA")]
    said = message_from_bytes(inside.read(metadata))
    assert said["Description-Content-Type"] == "text/markdown"
    assert said["Version"] == PROJECT["version"]
    description = str(said.get_payload())
    assert "# khepera-macor" in description
    # no file lies beside it on a package index
    assert not re.search(r"\]\((?!https?:|#)", description)


@pytest.mark.long
def test_the_tests_of_the_source_distribution_run(tmp_path: Path) -> None:
    source = tmp_path / "source"
    shutil.copytree(ROOT, source, ignore=NOT_THE_PROJECT)
    build = "import sys; from setuptools import build_meta; build_meta.build_sdist(sys.argv[1])"
    command = [sys.executable, "-c", build, str(tmp_path)]
    subprocess.run(command, cwd=source, check=True, timeout=PATIENCE, capture_output=True)
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as sources:
        sources.extractall(tmp_path, filter="data")
    unpacked = tmp_path / archive.name.removesuffix(".tar.gz")
    for folder in (".github", "benchmarks", "docs", "examples", "tests"):
        assert files_in(unpacked / folder) == files_in(source / folder)
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *OF_THE_SOURCES]
    outside = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST")}
    done = subprocess.run(
        command,
        cwd=unpacked,
        env={**outside, "PYTHONPATH": f"{unpacked}{os.pathsep}{unpacked / 'protocol'}"},
        timeout=3 * PATIENCE,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def files_in(folder: Path) -> set[str]:
    return {str(f.relative_to(folder)) for f in folder.rglob("*") if f.is_file()}


def test_every_extra_is_tried_without() -> None:
    for_developers = {"benchmarks", "build", "docs", "lint", "release", "test", "tracking"}
    assert set(NEEDS.values()) == set(PROJECT["optional-dependencies"]) - for_developers


FORK = ["pybullet-arm64"]


@pytest.mark.parametrize(
    ("system", "processor", "found"),
    [
        ("linux", "x86_64", [["pybullet"], FORK, FORK, []]),
        ("darwin", "arm64", [FORK, FORK, FORK, []]),
        ("win32", "AMD64", [FORK, FORK, FORK, []]),
        ("linux", "aarch64", [[], [], [], []]),
    ],
)
def test_every_python_gets_the_pybullet_that_there_is_a_wheel_of(
    system: str, processor: str, found: list[list[str]]
) -> None:
    wanted = [Requirement(line) for line in PROJECT["optional-dependencies"]["emulator"]]
    place = {"sys_platform": system, "platform_machine": processor}
    for minor, names in enumerate(found, start=11):
        environment = {**place, "python_version": f"3.{minor}"}
        assert names == [
            each.name for each in wanted if not_none(each.marker).evaluate(environment)
        ]
        # the advice where it is missing is to install the extra, or says that there is none
        assert bool(names) == (minor < 14 and (system, processor) in WHEELS)


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_every_python_that_is_found_takes_the_wheel_and_asks_for_a_picture(tmp_path: Path) -> None:
    wheel = pythons.build_wheel(tmp_path)
    tests = ("test_motors.py", "test_without_pybullet.py")
    found = pythons.found()
    assert sys.version_info[1] in found
    for minor, python in found.items():
        row = pythons.try_python(python, wheel, tmp_path / str(minor), tests)
        assert row.python.startswith(f"3.{minor}.")
        assert row.arena == ("corridor" if row.physics == "none" else "toys")
        assert " passed" in row.tests


STUBS = {
    "leads nowhere": "exit 127",
    "too old": "exit 1",
    "new enough": "exit 0",
}
"""Interpreters that answer whether they are new enough, as scripts."""


@pytest.mark.parametrize(
    ("there", "taken"),
    [
        ({"python3.11": "new enough", "python3.13": "new enough"}, "python3.11"),
        ({"python3.11": "leads nowhere", "python3.12": "new enough"}, "python3.12"),
        ({"python3.14": "new enough", "python3": "new enough"}, "python3.14"),
        ({"python3": "too old", "python": "new enough"}, "python"),
        ({"python3": "too old"}, ""),
        ({}, ""),
    ],
)
def test_make_takes_the_first_python_that_runs_and_is_new_enough(
    there: dict[str, str], taken: str, tmp_path: Path
) -> None:
    for name, kind in there.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{STUBS[kind]}\n")
        (tmp_path / name).chmod(0o755)
    make = not_none(shutil.which("make"))
    told = subprocess.run(
        [make, "--eval", "told: ; @echo '$(PYTHON)';", "told"],
        cwd=ROOT,
        env={"PATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert told.stdout.strip() == taken


def test_every_extra_is_documented() -> None:
    page = (ROOT / "docs" / "install.md").read_text("utf-8")
    documented = set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE))
    for_developers = {"build", "docs", "lint", "release", "test", "tracking"}
    assert documented == set(PROJECT["optional-dependencies"]) - for_developers


def test_the_controller_is_importable_without_any_extra() -> None:
    code = f"""
import importlib, json
failed = {{}}
for name in {list(modules("macor_hil")) + list(modules("khepera_protocol"))}:
    try:
        importlib.import_module(name)
    except ImportError as error:
        failed[name] = (error.name or "").partition(".")[0]
print(json.dumps(failed))
"""
    done = without_extras(code)
    assert done.returncode == 0, done.stderr
    for module, missing in json.loads(done.stdout).items():
        extra = next((extra for name, extra in MAY_FAIL.items() if module.startswith(name)), None)
        assert extra is not None, f"{module} needs {missing}"


@pytest.mark.parametrize("program", ["macor_hil.cli", "khepera_emulator.app.cli"])
def test_the_command_lines_help_without_any_extra(program: str) -> None:
    done = without_extras(f"from {program} import app; app()", "--help")
    assert done.returncode == 0, done.stderr
    assert "Usage" in done.stdout


@pytest.mark.parametrize(
    ("program", "arguments", "extra"),
    [
        ("khepera_emulator.app.cli", ["run", "--arena", "toys"], "emulator"),
        ("macor_hil.cli", ["look", "--port", "khepera://toys", "--picture", "F.png"], "emulator"),
        ("macor_hil.cli", ["ros2"], "ros"),
        ("macor_hil.cli", ["dashboard"], "dashboard"),
        ("macor_hil.cli", ["record", "FILE"], "recording"),
        ("macor_hil.cli", ["replay", "FILE"], "recording"),
        ("macor_hil.cli", ["reproduce", "figure2"], "experiments"),
    ],
)
def test_a_missing_extra_is_named(
    program: str, arguments: list[str], extra: str, tmp_path: Path
) -> None:
    file = str(tmp_path / "file")
    arguments = [each.replace("FILE", file) for each in arguments]
    done = without_extras(f"from {program} import main; main()", *arguments)
    assert done.returncode == 2
    assert extra in PROJECT["optional-dependencies"]
    assert extra in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("program", ["khepera_emulator.app.cli", "macor_hil.cli"])
def test_a_program_tells_its_version(program: str) -> None:
    command = [sys.executable, "-m", program, "--version"]
    said = subprocess.run(command, timeout=PATIENCE, capture_output=True, text=True, check=True)
    assert said.stdout.strip() == f"{PROJECT['name']} {PROJECT['version']}"


@pytest.mark.parametrize("package", ["khepera_emulator", "khepera_protocol", "macor_hil"])
def test_a_package_tells_its_version_and_nothing_that_it_has_not(package: str) -> None:
    module = import_module(package)
    assert module.__version__ == PROJECT["version"]
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'versoin'"):
        _ = module.versoin


@pytest.mark.parametrize(
    "shell",
    [
        "bash",
        pytest.param("zsh", marks=pytest.mark.long),
        pytest.param("fish", marks=pytest.mark.long),
    ],
)
@pytest.mark.parametrize("program", ["khepera-emulator", "macor-hil"])
def test_a_shell_completes_commands(program: str, shell: str) -> None:
    module = {"khepera-emulator": "khepera_emulator.app.cli", "macor-hil": "macor_hil.cli"}[program]
    variable = f"_{program.replace('-', '_')}_COMPLETE".upper()
    code = f"import sys; sys.argv[0] = {program!r}; from {module} import main; main()"

    def run(**variables: str) -> str:
        return subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, **variables},
            timeout=PATIENCE,
            capture_output=True,
            text=True,
            check=True,
        ).stdout

    assert variable in run(**{variable: f"source_{shell}"})
    line = f"{program} re"
    typed = {"COMP_WORDS": line, "COMP_CWORD": "1", "_TYPER_COMPLETE_ARGS": line}
    fish = {"_TYPER_COMPLETE_FISH_ACTION": "get-args"} if shell == "fish" else {}
    offered = run(**{variable: f"complete_{shell}"}, **typed, **fish)
    assert "replay" in offered
    assert "truth" not in offered
    assert "train" not in offered
