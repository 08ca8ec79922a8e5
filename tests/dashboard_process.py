"""A dashboard in a process of its own."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

PATIENCE = 60.0


@contextmanager
def dashboard(*arguments: str, code: str = "") -> Iterator[str]:
    """A dashboard process, or that of some code in its place; gives its address."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    program = ["-c", code] if code else ["-m", "macor_hil.cli"]
    command = [sys.executable, "-u", *program, "dashboard", "--port", str(port)]
    # NiceGUI serves its own tests when it finds itself in pytest
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST")}
    with subprocess.Popen(
        [*command, *arguments], stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            assert address == f"http://127.0.0.1:{port}"
            yield address
        finally:
            process.terminate()
            assert process.wait(PATIENCE) == 0
