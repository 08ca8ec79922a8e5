"""`make soak-watchers`: an hour of eight robots, 300 runs of controllers, and those who watch them.

Emulator, controllers, monitor, recorder and dashboard are processes. The robots live five times
faster than real ones, so that an hour of them takes twelve minutes; the controllers drive in real
time as they do everywhere. Every run is a process of its own, started when the one before has
ended. A browser is taken for one by opening the page's WebSocket.
What is asked: memory and descriptors of every process that stays are flat.

With `--minutes N` the robots live N minutes instead, and as many runs are asked for as fit.
"""

import json
import os
import pty
import re
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from emulator_process import EmulatorProcess, free_endpoint
from khepera_protocol.zenoh.payloads import Reset
from page import DOCS, table, write_part
from rich.console import Console
from rig import Controller
from short_training import train_shortly
from soak_service import Use, use_of
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from macor_hil.errors import BenchError
from macor_hil.hardware.bench import ZenohBench
from macor_hil.telemetry.session import open_session

_ROBOTS: Final = 8
_SPEED: Final = 5.0
_HOUR: Final = 60.0
_RUNS: Final = 300
_COMMANDS: Final = 8
"""Commands of a run at most."""

_WARM: Final = 0.4
_PART: Final = 0.1
"""Part of the time after which memory and descriptors are looked at, and for how much of it: by
then what is loaded late is loaded, and Zenoh has buffers for as many peers as come at a time."""

_MEMORY: Final = 8.0
"""MB that a process may grow by; shared memory that is kept would be 17 MB a run."""

_DESCRIPTORS: Final = 10
"""Descriptors likewise: sessions of controllers that are open, and some that just close."""

_TOLD: Final = 8
"""Ways in which runs ended that are told."""

_HERE: Final = Path(__file__).parent


class Soak:
    """Robots, controllers and watchers, while they run.

    Args:
        stack: ends them.
        folder: for their files.
    """

    def __init__(self, stack: ExitStack, folder: Path) -> None:
        self._endpoint = free_endpoint()
        emulator = EmulatorProcess(
            *("--robots", str(_ROBOTS), "--speed", f"{_SPEED:g}", "--arena", "open-box"),
            *("--baud", "57600", "--link", str(folder / "robot"), "--listen", self._endpoint),
        )
        stack.callback(emulator.end)
        session = stack.enter_context(open_session([], [self._endpoint]))
        self._benches = [ZenohBench(session, f"khepera-{k}") for k in range(1, _ROBOTS + 1)]
        trained = train_shortly(folder / "map.npz")
        endpoints = [free_endpoint() for _ in range(_ROBOTS)]
        self._start = [
            partial(self._controller, folder, k, trained, endpoint)
            for k, endpoint in enumerate(endpoints, start=1)
        ]
        self._controllers = [start() for start in self._start]
        stack.callback(self._close)
        self.decisions = 0
        self.runs = 0
        self.ends: Counter[str] = Counter()
        connect = [part for each in (self._endpoint, *endpoints) for part in ("--connect", each)]
        self.pids = {"emulator": emulator.process.pid}
        for name, command in (
            ("monitor", ["monitor", "--robot", "khepera-1"]),
            ("recorder", ["record", str(folder / "drive.mcap"), "--robot", "khepera-2"]),
            ("dashboard", ["dashboard", "--robot", "khepera-3", "--port", str(_free_port())]),
        ):
            self.pids[name] = stack.enter_context(_watcher([*command, *connect]))
            if name == "dashboard":
                stack.enter_context(_browser(f"http://127.0.0.1:{command[-1]}"))

    def _controller(self, folder: Path, k: int, trained: Path, endpoint: str) -> Controller:
        values = {
            "port": str(folder / f"robot-{k}"),
            "map_file": str(trained),
            "baud": 57600,
            "commands": _COMMANDS,
            "planner": "circle",
            "robot": f"khepera-{k}",
            "listen": [endpoint],
            "connect": [self._endpoint],
        }
        script = _HERE.parent / "tests" / "controller_process.py"
        return Controller([sys.executable, str(script), json.dumps(values)])

    def clock(self) -> float:
        """Seconds that the robots have lived; an emulator on a busy machine may answer late."""
        while True:
            with suppress(BenchError):
                return self._benches[0].truth().time

    def attend(self) -> None:
        """Count the runs that have ended, put robots that collided somewhere else, start others."""
        for k, controller in enumerate(self._controllers):
            if controller.process.poll() is None:
                continue
            how = controller.end()
            controller.close()
            self.runs += 1
            self.decisions += controller.steps()
            # a number in it says which robot, not what happened
            self.ends[re.sub(r"\d+", "N", how)] += 1
            if not how.startswith("all commands"):
                with suppress(BenchError):  # no free place just now; the next run will tell
                    self._benches[k].reset(Reset(random=True))
            self._controllers[k] = self._start[k]()
        for name, pid in self.pids.items():
            if not Path(f"/proc/{pid}/fd").exists() or use_of(pid).memory == 0.0:
                raise SystemExit(f"{name} ended")

    def _close(self) -> None:
        for controller in self._controllers:
            controller.close()


@contextmanager
def _watcher(arguments: list[str]) -> Iterator[int]:
    """Run a program that watches, on a terminal that somebody reads; gives its number."""
    ours, its = pty.openpty()
    command = [sys.executable, "-m", "macor_hil.cli", *arguments]
    with subprocess.Popen(command, stdin=its, stdout=its, stderr=its) as process:
        os.close(its)
        reader = threading.Thread(target=_read_all, args=(ours,), daemon=True)
        reader.start()
        try:
            yield process.pid
        finally:
            process.terminate()
            process.wait()
            reader.join()
            os.close(ours)


def _read_all(descriptor: int) -> None:
    try:
        while os.read(descriptor, 1 << 16):
            pass
    except OSError:
        pass  # the other side of the terminal is closed


@contextmanager
def _browser(address: str) -> Iterator[None]:
    """Open a page as a browser does, and take what its WebSocket sends."""
    taken: list[int] = []

    def take(page: ClientConnection) -> None:
        taken.extend(len(message) for message in page)

    live = f"{address.replace('http', 'ws', 1)}/live"
    with connect(live, origin=Origin(address), max_size=None) as page:
        page.send("{}")
        taking = threading.Thread(target=take, args=(page,))
        taking.start()
        try:
            yield
        finally:
            page.close()
            taking.join()
            if not taken:
                raise SystemExit("the dashboard drew nothing")


def _free_port() -> int:
    return int(free_endpoint().rpartition(":")[2])


def _text(soak: Soak, lived: float, uses: dict[str, list[Use]]) -> str:
    head = ("process", "memory at 40 %", "memory at the end", "descriptors", "threads")
    rows = []
    for name, all_uses in uses.items():
        early, late = _ends(all_uses)
        memory = [f"{min(use.memory for use in part):.1f} MB" for part in (early, late)]
        rest = [
            " to ".join(f"{min(use[place] for use in part):g}" for part in (early, late))
            for place in (1, 2)
        ]
        rows.append((name, *memory, *rest))
    return (
        f"{lived / 60:.0f} minutes of {_ROBOTS} robots, {soak.runs} runs, {soak.decisions}"
        f" decisions.\n\n{table(head, rows)}"
        f"\n\nRuns ended:\n\n{table(('how', 'runs'), _ways(soak.ends))}"
    )


def _ways(ends: Counter[str]) -> list[tuple[str, str]]:
    return [(how, str(runs)) for how, runs in ends.most_common(_TOLD)]


def _ends(uses: list[Use]) -> tuple[list[Use], list[Use]]:
    start, count = round(_WARM * len(uses)), max(1, round(_PART * len(uses)))
    return uses[start : start + count], uses[-count:]


def _grown(uses: dict[str, list[Use]]) -> list[str]:
    """Return what is not flat."""
    found = []
    for name, all_uses in uses.items():
        early, late = _ends(all_uses)
        for place, limit, unit in ((0, _MEMORY, "MB"), (1, _DESCRIPTORS, "descriptors")):
            # the least: while peers come and go there are more for a moment, and a leak stays
            more = min(use[place] for use in late) - min(use[place] for use in early)
            if more > limit:
                found.append(f"{name}: {more:.1f} {unit} more")
    return found


def main() -> None:
    """Run it and print the table; `--write` puts it into docs/soak.md, too."""
    arguments = sys.argv[1:]
    minutes = float(arguments[arguments.index("--minutes") + 1]) if "--minutes" in arguments else 0
    console, uses = Console(), dict[str, list[Use]]()
    wanted = 0 if minutes else _RUNS
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        soak = Soak(stack, folder)
        first, told = soak.clock(), 0.0
        while (lived := soak.clock() - first) < 60 * (minutes or _HOUR) or soak.runs < wanted:
            soak.attend()
            for name, pid in soak.pids.items():
                uses.setdefault(name, []).append(use_of(pid))
            if lived - told > 300.0:
                told = lived
                console.print(f"{lived / 60:.0f} min: {soak.runs} runs, {soak.decisions} decisions")
            time.sleep(0.5)
        text = _text(soak, lived, uses)
    console.print(text)
    if "--write" in arguments:
        write_part(DOCS / "soak.md", "watchers", text)
    if grown := _grown(uses):
        raise SystemExit("; ".join(grown))


if __name__ == "__main__":
    main()
