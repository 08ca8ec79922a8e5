"""`khepera-emulator run` as a process of its own, for tests that need the real thing."""

import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

COMMAND = (sys.executable, "-m", "khepera_emulator.app.cli", "run")
PATIENCE = 30.0
"""Seconds after which a test gives up waiting for what must come."""


class EmulatorProcess:
    """A running emulator; `announcement` is the line it printed, `path` its terminal."""

    def __init__(self, *options: str, **popen: Any) -> None:
        self.process: subprocess.Popen[str] = subprocess.Popen(
            [*COMMAND, *options],
            **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **popen},
        )
        assert self.process.stdout is not None
        self.announcement = self.process.stdout.readline().rstrip("\n")
        if not self.announcement:
            raise AssertionError(self.process.communicate()[1])
        self.path = self.announcement.partition(" on ")[2].partition(",")[0]

    def end(self, number: int = signal.SIGTERM) -> tuple[int, str]:
        """Send a signal and wait; returns exit status and the standard error output, if piped."""
        if self.process.poll() is None:
            os.kill(self.process.pid, number)
        said: str = self.process.communicate(timeout=PATIENCE)[1] or ""
        return self.process.returncode, said


@contextmanager
def emulator(*options: str, **popen: Any) -> Iterator[EmulatorProcess]:
    running = EmulatorProcess(*options, **popen)
    try:
        yield running
    finally:
        running.end()


def has_ended(pid: int) -> bool:
    """Tell whether a process that is not ours ends, now or soon."""
    try:
        process = os.pidfd_open(pid)
    except ProcessLookupError:
        return True
    try:
        return bool(select.select([process], [], [], PATIENCE)[0])
    finally:
        os.close(process)


def free_endpoint() -> str:
    """A Zenoh endpoint on this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def link_options(folder: Path) -> tuple[str, ...]:
    return ("--no-zenoh", "--link", str(folder / "khepera"))
