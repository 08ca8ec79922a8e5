"""A Zenoh router for tests: a session in router mode, in a process that can be killed."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from emulator_process import free_endpoint

_SCRIPT = """
import sys, zenoh
with zenoh.open(zenoh.Config.from_file(sys.argv[1])):
    print("open", flush=True)
    sys.stdin.read()
"""


class Router:
    """A running router, and `client`, the configuration file of who reaches others through it."""

    def __init__(self, folder: Path) -> None:
        self.endpoint = free_endpoint()
        self._config = folder / "router.json5"
        self._config.write_text(json.dumps({"mode": "router", **_closed(listen=self.endpoint)}))
        self.client = folder / "client.json5"
        self.client.write_text(json.dumps({"mode": "client", **_closed(connect=self.endpoint)}))
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", _SCRIPT, str(self._config)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert self.process.stdout is not None
        self.process.stdout.readline()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.close()
        self.process.stdout.close()


def _closed(listen: str | None = None, connect: str | None = None) -> dict[str, Any]:
    """Zenoh settings: these endpoints, and no search for others."""
    retry = {"period_init_ms": 100, "period_max_ms": 1000}
    settings: dict[str, Any] = {
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "timestamping": {"enabled": True},
    }
    if listen:
        settings["listen"] = {"endpoints": [listen]}
    if connect:
        settings["connect"] = {
            "endpoints": [connect],
            "timeout_ms": -1,
            "exit_on_failure": False,
            "retry": retry,
        }
    return settings
