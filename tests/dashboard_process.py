"""A dashboard in a process of its own."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

PATIENCE = 60.0


@contextmanager
def dashboard(*arguments: str, code: str = "") -> Iterator[str]:
    """A dashboard process, or that of some code in its place; gives its address."""
    program = ["-c", code] if code else ["-m", "macor_hil.cli"]
    command = [sys.executable, "-u", *program, "dashboard", "--port", "0"]
    with subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            assert address.startswith("http")
            yield address
        finally:
            process.terminate()
            assert process.wait(PATIENCE) == 0
