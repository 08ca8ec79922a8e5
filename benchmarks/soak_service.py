"""`make soak-service`: an hour of service under random faults, in scaled time; for docs/safety.md.

Emulator and controller are processes. The emulated robot lives ten times faster than a real one, so
that an hour of it takes six minutes; the controller drives in real time as it does everywhere. The
line has all of its faults by chance; camera, emulator and watchers get theirs from here. A run that
has ended, by a collision or because nothing worked any more, is followed by the next one in the
same process. What is asked: nothing crashes, memory and descriptors of both stay flat.
"""

import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np
from khepera_protocol.zenoh.payloads import Reset
from page import DOCS, table, write_part
from rich.console import Console
from rig import Rig, rig
from short_training import train_shortly

from macor_hil.errors import BenchError
from macor_hil.telemetry.feed import Feed
from macor_hil.telemetry.session import open_session

_SPEED: Final = 10.0
_HOUR: Final = 3600.0
_SEED: Final = 1
_WARM: Final = 0.1
"""Part of the run after which memory is looked at: what is loaded late has been loaded."""

_LINE: Final = (
    *(f"{kind}:p=0.0003" for kind in ("drop", "flip", "duplicate")),
    "delay:p=0.0003,time=3",
    "truncate:p=0.002",
    "stray:p=0.002",
    *("stall:p=0.0003,for=10", "cut:p=0.0003,for=20", "reset:p=0.0003"),
)
_CAMERA: Final = ("lost", "frozen", "late", "dark", "small", "garbage")


class Use(NamedTuple):
    """The resources of a process: resident memory in MB, open descriptors, threads."""

    memory: float
    descriptors: int
    threads: int


def use_of(pid: int) -> Use:
    """Return the resources of a process now."""
    status = Path(f"/proc/{pid}/status").read_text()
    facts = dict(line.split(":", 1) for line in status.splitlines())
    memory = int(facts["VmRSS"].split()[0]) / 1024
    return Use(memory, len(list(Path(f"/proc/{pid}/fd").iterdir())), int(facts["Threads"]))


def main() -> None:
    """Run the hour and print what came of it; `--write` puts it into docs/safety.md, too."""
    console = Console()
    options = [item for fault in _LINE for item in ("--fault", fault)]
    with TemporaryDirectory() as folder, rig(folder, "--speed", f"{_SPEED:g}", *options) as bench:
        text = Soak(bench, train_shortly(Path(folder) / "map.npz")).run(console)
    console.print(text)
    if "--write" in sys.argv[1:]:
        write_part(DOCS / "safety.md", "soak", text)


class Soak:
    """The hour: faults on, measure, and count."""

    def __init__(self, bench: Rig, trained: Path) -> None:
        self._bench = bench
        self._rng = np.random.default_rng(_SEED)
        self._controller = bench.controller(
            trained, planner="circle", speed=60, acceleration=255, forever=True
        )
        self._befell: Counter[str] = Counter()
        self._seen = 0
        self._ends: Counter[str] = Counter()
        self._lost = 0

    def run(self, console: Console) -> str:
        """Run, and return the report of it."""
        controller, bench = self._controller, self._bench
        controller.wait_for_steps(1)
        pids = {"controller": controller.process.pid, "emulator": bench.emulator.process.pid}
        uses: dict[str, list[Use]] = {name: [] for name in pids}
        first, told = bench.truth()[0], 0.0
        while (lived := self._clock() - first) < _HOUR:
            self._befall()
            self._take_in()
            if controller.process.poll() is not None or bench.emulator.process.poll() is not None:
                raise SystemExit(f"a process ended: {controller.lines[-3:]}")
            for name, pid in pids.items():
                uses[name].append(use_of(pid))
            if lived - told > _HOUR / 12:
                told = lived
                ended = self._ends.total()
                console.print(f"{lived:.0f} s: {controller.steps()} decisions, {ended} runs ended")
        os.kill(controller.process.pid, signal.SIGTERM)
        controller.end()
        self._take_in()
        return self._text(uses)

    def _clock(self) -> float:
        """Read the robot's clock, even while the emulator is stopped."""
        while True:
            with suppress(BenchError):
                now: float = self._bench.truth()[0]
                return now

    def _befall(self) -> None:
        happenings: tuple[Callable[[], str], ...] = (self._blind, self._freeze, self._watch)
        what = happenings[int(self._rng.choice(3, p=(0.5, 0.1, 0.4)))]()
        self._befell[what] += 1
        time.sleep(self._rng.uniform(0.5, 3.0))

    def _blind(self) -> str:
        relay: Any = self._bench.relay
        relay.mode = str(self._rng.choice(_CAMERA))
        what = f"camera {relay.mode}"
        time.sleep(self._rng.uniform(0.2, 1.5))
        relay.mode = "pass"
        return what

    def _freeze(self) -> str:
        pid = self._bench.emulator.process.pid
        os.kill(pid, signal.SIGSTOP)
        time.sleep(self._rng.uniform(0.1, 1.0))
        os.kill(pid, signal.SIGCONT)
        return "emulator stopped"

    def _watch(self) -> str:
        """Let some watchers come, look for a while or not at all, and go."""
        endpoints = [self._bench.controller_endpoint, self._bench.endpoint]
        with ExitStack() as stack:
            for _ in range(int(self._rng.integers(1, 4))):
                session = stack.enter_context(open_session([], endpoints))
                feed = stack.enter_context(Feed(session, "khepera", camera=True))
                end = time.monotonic() + self._rng.uniform(0.0, 0.7)
                while time.monotonic() < end:
                    feed.get(0.1)
        return "watchers"

    def _take_in(self) -> None:
        """Take in what the controller has said since the last time."""
        lines = [line for line in self._controller.lines if line is not None]
        for line in lines[self._seen :]:
            if line == "step":
                continue
            ending, _, recoveries = line.rpartition(" ")
            if not recoveries.isdecimal():
                self._ends[line.partition(":")[0]] += 1
                continue
            self._lost += int(recoveries)
            self._ends[ending.strip()] += 1
            if ending.startswith("collision"):
                self._bench.bench.reset(Reset())  # away from the wall
        self._seen = len(lines)

    def _text(self, uses: dict[str, list[Use]]) -> str:
        head = (
            "process",
            "memory, first tenth past",
            "memory, last tenth",
            "descriptors",
            "threads",
        )
        rows = []
        for name, all_uses in uses.items():
            count = max(1, round(_WARM * len(all_uses)))
            early, late = all_uses[count : 2 * count], all_uses[-count:]
            memory = [f"{median(use.memory for use in part):.1f} MB" for part in (early, late)]
            rows.append((name, *memory, _from_to(early, late, 1), _from_to(early, late, 2)))
        ends = ", ".join(f"{count} x {what}" for what, count in sorted(self._ends.items()))
        befell = ", ".join(f"{count} x {what}" for what, count in sorted(self._befell.items()))
        return (
            f"{self._controller.steps()} decisions, recovered from {self._lost} failures (each costs"
            f" a decision) in runs that ended: {ends}. Beside the faults of the line there were:"
            f" {befell}.\n\n{table(head, rows)}"
        )


def _from_to(early: list[Use], late: list[Use], place: int) -> str:
    first, last = (median(use[place] for use in some) for some in (early, late))
    return f"{first:g} to {last:g}"


if __name__ == "__main__":
    main()
