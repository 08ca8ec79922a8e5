"""`make pythons`: the wheel on every CPython that is found, from wheels alone; for docs/install.md.

In an empty environment each: the wheel with its extra `emulator`, `khepera-emulator run` with a
picture of its camera asked for, and a part of the tests. Arguments are further Pythons. Where the
newest is not found, which has no PyBullet, the last one that is found is tried without, too.
"""

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

from emulator_process import free_endpoint
from page import DOCS, report
from rich.console import Console

ROOT: Final = Path(__file__).parent.parent

NEWEST: Final = 14
"""Minor version of the newest CPython that the package is for."""

PART: Final = (
    "test_protocol_framing.py",
    "test_motors.py",
    "test_fuzzy_art.py",
    "test_golden.py",
    "test_camera.py",
    "test_things.py",
    "test_without_pybullet.py",
)
"""Tests of each package, and of what differs between Pythons."""

NEEDY: Final = ("test_camera.py", "test_things.py")
"""Those among them that import PyBullet."""

_TOOLS: Final = ("pytest", "pytest-timeout", "hypothesis")
_PHYSICS: Final = ("pybullet", "pybullet-arm64")
_HEAD: Final = ("CPython", "PyBullet", "wheels", "installed in", "arena", "picture after", "tests")

_LOOK: Final = """
import sys, zenoh
from khepera_protocol.zenoh.config import zenoh_config
with zenoh.open(zenoh.Config.from_json5(zenoh_config([], [sys.argv[1]]))) as session:
    (reply,) = session.get("khepera/khepera/camera", payload='{"encoding":"png"}', timeout=20)
    picture = reply.ok.payload.to_bytes()
    assert picture.startswith(b"\\x89PNG"), picture
"""


class Row(NamedTuple):
    """Outcome on one Python, as it stands in the table."""

    python: str
    physics: str
    wheels: int
    install: float
    arena: str
    picture: float
    tests: str


class Environment:
    """An environment that has nothing in it but pip.

    Args:
        python: the interpreter that it is made with.
        folder: where it is made.
    """

    def __init__(self, python: str, folder: Path) -> None:
        subprocess.run([python, "-m", "venv", str(folder)], check=True)
        self._bin = folder / ("Scripts" if os.name == "nt" else "bin")
        outside = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        self._environ = {**outside, "PYTHONNOUSERSITE": "1"}

    def command(self, name: str, *arguments: str) -> list[str]:
        """Return a command of the environment with its arguments."""
        return [str(self._bin / name), *arguments]

    def run(self, name: str, *arguments: str, check: bool = True) -> str:
        """Run a command of the environment in the project's folder; returns what it said."""
        done = subprocess.run(
            self.command(name, *arguments),
            cwd=ROOT,
            env=self._environ,
            capture_output=True,
            text=True,
            check=False,
        )
        if check and done.returncode:
            raise RuntimeError(f"{name} {' '.join(arguments)}: {done.stdout}{done.stderr}")
        return done.stdout

    def install(self, *what: str) -> None:
        """Install something from wheels alone."""
        self.run("python", "-m", "pip", "install", "--quiet", "--only-binary", ":all:", *what)

    def packages(self) -> dict[str, str]:
        """Return the versions of what is installed, by its name."""
        lines = self.run("python", "-m", "pip", "list", "--format=freeze").splitlines()
        return dict(line.split("==") for line in lines if "==" in line)

    def first_picture(self, arena: str) -> float:
        """Return seconds from starting an emulator to a picture of its camera."""
        begin = time.monotonic()
        endpoint = free_endpoint()
        words = ("run", "--arena", arena, "--listen", endpoint)
        with subprocess.Popen(
            self.command("khepera-emulator", *words),
            env=self._environ,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as emulator:
            try:
                assert emulator.stdout is not None
                if not emulator.stdout.readline():
                    raise RuntimeError(emulator.communicate()[1])
                self.run("python", "-c", _LOOK, endpoint)
            finally:
                emulator.terminate()
        return time.monotonic() - begin


def found(more: Iterable[str] = ()) -> dict[int, str]:
    """Return a CPython of each minor version from 11 on: on the path, of pyenv, or as given."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    names = [f"python3.{minor}" for minor in range(11, NEWEST + 1)]
    kept = sorted(str(each) for each in pyenv.glob("versions/*/bin/python"))
    pythons: dict[int, str] = {}
    for python in [*more, *names, "python3", sys.executable, *kept]:
        if (minor := _minor_of(python)) and 11 <= minor <= NEWEST:
            pythons.setdefault(minor, python)
    return dict(sorted(pythons.items()))


def _minor_of(python: str) -> int | None:
    """Return the minor version of a CPython 3 that runs; None: it does not."""
    code = "import sys, venv; print(sys.implementation.name, *sys.version_info[:2])"
    try:
        done = subprocess.run([python, "-c", code], capture_output=True, text=True, check=False)
    except OSError:
        return None
    said = re.fullmatch(r"cpython 3 (\d+)\n", done.stdout)
    return int(said[1]) if said else None


def build_wheel(folder: Path) -> Path:
    """Return a wheel of the project, built into a folder."""
    words = ("-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation")
    subprocess.run([sys.executable, *words, "--wheel-dir", str(folder), str(ROOT)], check=True)
    (wheel,) = folder.glob("*.whl")
    return wheel


def try_python(
    python: str, wheel: Path, folder: Path, tests: Sequence[str] = PART, *, physics: bool = True
) -> Row:
    """Install the wheel with a Python, ask for a picture, run tests; a failure is an error.

    Args:
        python: the interpreter.
        wheel: of this project.
        folder: for the environment.
        tests: names of files in `tests`.
        physics: whether PyBullet may be there.
    """
    made = Environment(python, folder)
    begin = time.monotonic()
    made.install(f"{wheel}[emulator]")
    seconds = time.monotonic() - begin
    packages = made.packages()
    if not physics:
        made.run("python", "-m", "pip", "uninstall", "--yes", "--quiet", *_PHYSICS)
        packages = made.packages()
    has = next((f"{name} {packages[name]}" for name in _PHYSICS if name in packages), "none")
    arena = "corridor" if has == "none" else "toys"
    picture = made.first_picture(arena)
    made.install(*_TOOLS)
    left_out = () if has != "none" else NEEDY
    files = [f"tests/{name}" for name in tests if name not in left_out]
    said = made.run("pytest", "-p", "no:cacheprovider", "-m", "not long", *files, check=False)
    closing = (said.splitlines() or [""])[-1]
    if "passed" not in closing or "failed" in closing or "error" in closing:
        raise RuntimeError(f"{python}: {said}")
    version = made.run("python", "--version").split()[1]
    return Row(version, has, len(packages) - 2, seconds, arena, picture, closing)


def main() -> None:
    """Try and print; `--write` puts the table into docs/install.md, too."""
    pythons = found(word for word in sys.argv[1:] if not word.startswith("-"))
    with TemporaryDirectory() as folder:
        wheel = build_wheel(Path(folder))
        tries = [(python, f"3.{minor}", True) for minor, python in pythons.items()]
        if NEWEST not in pythons:
            tries.append((pythons[max(pythons)], "without", False))
        rows = []
        for python, name, physics in tries:
            rows.append(try_python(python, wheel, Path(folder) / name, physics=physics))
            Console().print(rows[-1])
    cells = [
        (
            *(row.python, row.physics, str(row.wheels), f"{row.install:.0f} s", f"`{row.arena}`"),
            *(f"{row.picture:.1f} s", row.tests.split(" in ")[0]),
        )
        for row in rows
    ]
    note = "Processors that other programs shared: seconds are of a busy machine."
    report("CPython, from wheels alone", _HEAD, cells, (DOCS / "install.md", "pythons"), note)


if __name__ == "__main__":
    main()
