r"""Runs the commands of a page of the documentation, in order, as someone who pastes them would.

    unshare --map-root-user --net --pid --fork --kill-child \
        python tests/docs_runner.py docs/arenas.md FOLDER

Commands are the lines of its `sh` blocks. They run in a folder that has the project's files in it
and in a network of their own, so that every page has the well-known ports to itself. Commands that
stay (an emulator, a monitor) run on until the page ends or the same command comes again. What
takes minutes, needs a registry or a robot is looked at instead of run: see ELSEWHERE.
"""

import re
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

from emulator_process import PATIENCE

ROOT = Path(__file__).parent.parent
PROGRAMS = ("docker", "khepera-emulator", "macor-hil", "make", "pip", "python")
STAYS = (
    *("khepera-emulator run", "khepera-emulator watch"),
    *("macor-hil dashboard", "macor-hil foxglove", "macor-hil monitor", "macor-hil ros2"),
)

ELSEWHERE = {
    r"make ": "Makefile: minutes, or the very tests that are running",
    r"pip ": "needs a registry of packages",
    r"(\w+=\S+ )*docker ": "needs a Docker engine: tests/test_docker.py, docs/docker.md",
    r".* (/dev/tty|epuck2://)": "needs a robot",
    r"python benchmarks/": "minutes of measuring",
    r"python -m pytest test_approach.py": "a test for each language: tests/test_clients.py",
    r"python examples/gymnasium_learner.py": "minutes of learning: tests/test_environment.py",
    r"macor-hil reproduce ": "half an hour and more: tests/test_experiments.py",
    r"macor-hil train .*runs/corridor.npz": "minutes: tests/test_macor_cli.py",
    r"macor-hil (train|run) .*runs/maze.npz": "minutes: tests/test_goals.py",
    r"macor-hil (train|run|trials) .*runs/epuck.npz": "minutes: tests/test_epuck_client.py",
    r"macor-hil train .*--camera own": "minutes: tests/test_front_camera.py",
    r"macor-hil (run|trials) .*runs/corridor.npz": "needs that map: tests/test_service.py",
}
"""Commands that are not run here, and why or where they are instead."""

MADE = {
    "bad-day.txt": "12 reset\n",
    "my-arena.toml": (ROOT / "khepera_emulator" / "arenas" / "corridor.toml").read_text("utf-8"),
}
"""Files that pages speak of as the reader's own."""

ENDED = (0, 130, -signal.SIGTERM)
"""Exit statuses of what was told to end."""


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, the line it begins in, its text."""

    language: str
    line: int
    text: str

    @property
    def file(self) -> str | None:
        """The name of the file that it is, if its first line is a comment that says so."""
        found = re.match(r"(?:#|//) ([\w-]+\.(?:py|c|java))\n", self.text)
        return found[1] if found else None

    def commands(self) -> list[str]:
        """The commands in it, without their comments."""
        joined = self.text.replace("\\\n", " ")
        lines = (re.sub(r"\s+#.*|^#.*", "", line).strip() for line in joined.splitlines())
        return [line.removeprefix(".venv/bin/") for line in lines if line]


def blocks(page: Path) -> list[Block]:
    """The fenced blocks of a page."""
    text = page.read_text("utf-8")
    return [
        Block(found[1], text.count("\n", 0, found.start()) + 1, found[2])
        for found in re.finditer(r"^```([\w{}-]*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    ]


def elsewhere(command: str) -> str | None:
    """Return the reason not to run a command here; None to run it."""
    return next((why for what, why in ELSEWHERE.items() if re.match(what, command)), None)


@dataclass
class Shell:
    """Runs commands in a folder.

    Attributes:
        staying: commands that run on, by their first words.
    """

    folder: Path
    staying: dict[str, subprocess.Popen[str]] = field(default_factory=dict)

    def run(self, command: str) -> None:
        """Run a command; one that stays is left running."""
        stays = next((each for each in STAYS if command.startswith(each)), None)
        if stays:
            self._start(stays, command)
        else:
            done = subprocess.run(
                ["bash", "-c", command],
                cwd=self.folder,
                capture_output=True,
                text=True,
                timeout=4 * PATIENCE,  # the first time it may make machine code
                check=False,
            )
            if done.returncode:
                raise SystemExit(f"{command}: status {done.returncode}\n{done.stderr}")

    def close(self) -> None:
        """End what still runs, the last first."""
        for name in reversed(list(self.staying)):
            self._end(name)

    def _start(self, name: str, command: str) -> None:
        if name in self.staying:
            self._end(name)
        announces = name == "khepera-emulator run"
        process = subprocess.Popen(
            ["bash", "-c", f"exec {command}"],
            cwd=self.folder,
            stdout=subprocess.PIPE if announces else subprocess.DEVNULL,
            text=True,
        )
        self.staying[name] = process
        if process.stdout is not None and not process.stdout.readline():
            raise SystemExit(f"{name}: does not announce its robot")

    def _end(self, name: str) -> None:
        process = self.staying.pop(name)
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        process.communicate(timeout=PATIENCE)
        if process.returncode not in ENDED:
            raise SystemExit(f"{name}: status {process.returncode}")


def main() -> None:
    """Run a page's commands in a folder."""
    page, folder = Path(sys.argv[1]), Path(sys.argv[2])
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    for name in ("benchmarks", "docker", "docs", "examples", "README.md", "pyproject.toml"):
        (folder / name).symlink_to(ROOT / name)
    (folder / "runs").mkdir()
    for name, text in MADE.items():
        (folder / name).write_text(text, "utf-8")
    for block in blocks(page):
        if block.file:
            (folder / block.file).write_text(block.text, "utf-8")
    shell = Shell(folder)
    try:
        for block in blocks(page):
            for command in block.commands() if block.language == "sh" else ():
                if not elsewhere(command):
                    shell.run(command)
    finally:
        shell.close()


if __name__ == "__main__":
    main()
