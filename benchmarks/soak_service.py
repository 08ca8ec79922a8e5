"""`make soak-service`: service under random faults, in scaled time; for docs/safety.md.

    PYTHONPATH=tests python benchmarks/soak_service.py [--hours H] [--speed S] [--write]

Emulator and controller are processes. The emulated robot lives ten times faster than a real one, so
that an hour of it takes six minutes; the controller drives in real time as it does everywhere. It
waits, backs off, learns on and never gives up. The line has all of its faults by chance; the wall
clock of the controller is set anew again and again; camera, Zenoh session of the camera, emulator
and watchers get their faults from here. Now and then emulator and controller are killed, or told to
end, and started again, as a supervisor does. What is asked: decisions go on, nothing that was
learned is lost, memory and descriptors of both stay flat. A week is `--hours 168`.
"""

import os
import signal
import time
from argparse import ArgumentParser
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack, suppress
from itertools import pairwise
from math import inf
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np
from page import DOCS, table, write_part
from rich.console import Console
from rig import Controller, Rig, rig
from short_training import train_shortly

from macor_hil.errors import BenchError
from macor_hil.mind.map_file import load_map
from macor_hil.runs.learning.learning_on import LIVED
from macor_hil.telemetry.feed import Feed
from macor_hil.telemetry.session import open_session

_SPEED: Final = 10.0
_HOUR: Final = 3600.0
_SEED: Final = 1
_SETTLED: Final = 20
"""Looks at a process after which what is loaded late has been loaded."""

_PAUSES: Final = (0.5, 3.0)
"""Seconds from one thing that befalls to the next."""

_LINE: Final = (
    *(f"{kind}:p=0.0003" for kind in ("drop", "flip", "duplicate")),
    "delay:p=0.0003,time=3",
    "truncate:p=0.002",
    "stray:p=0.002",
    *("stall:p=0.0003,for=10", "cut:p=0.0003,for=20", "reset:p=0.0003"),
)
_SILENT: Final = 120.0
"""Seconds without a decision after which the service has failed."""

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
    """Run for so long and print what came of it; `--write` puts it into docs/safety.md, too."""
    parser = ArgumentParser()
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--speed", type=float, default=_SPEED)
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    console = Console()
    options = [item for fault in _LINE for item in ("--fault", fault)]
    with (
        TemporaryDirectory() as folder,
        rig(folder, "--speed", f"{given.speed:g}", *options) as bench,
    ):
        trained = train_shortly(Path(folder) / "map.npz")
        text = Soak(bench, trained, given.hours * _HOUR).run(console)
    text = f"{given.hours:g} h of the robot, {given.speed:g} times faster. {text}"
    console.print(text)
    if given.write:
        write_part(DOCS / "safety.md", "soak", text)


class Life(NamedTuple):
    """The looks at one process, from its start to its end."""

    name: str
    uses: list[Use]


class Soak:
    """A time of service: faults on, measure, and count.

    Args:
        bench: emulator and camera.
        trained: map that is driven by, and learned on.
        seconds: of the robot's time.
    """

    def __init__(self, bench: Rig, trained: Path, seconds: float) -> None:
        self._bench = bench
        self._map = trained
        self._seconds = seconds
        self._rng = np.random.default_rng(_SEED)
        self._befell: Counter[str] = Counter()
        self._lives: list[Life] = []
        self._steps = 0
        self._lost: list[int] = []
        self._longest = 0.0
        self._ended: Counter[str] = Counter()
        self._controller = self._started()
        self._live("emulator")

    def run(self, console: Console) -> str:
        """Run, and return the report of it.

        Raises:
            SystemExit: a process ended by itself, decisions stopped, or something learned was lost.
        """
        self._controller.wait_for_steps(1)
        happenings: dict[Callable[[], str], float] = {
            self._blind: 0.42,
            self._watch: 0.33,
            self._part: 0.14,
            self._freeze: 0.10,
            self._restart_controller: 0.004,
            self._kill_controller: 0.003,
            self._restart_emulator: 0.003,
        }
        # each of them once at least, and early: what lives long is to be seen, too
        due = [self._restart_controller, self._kill_controller, self._restart_emulator]
        lived, last, told = 0.0, self._clock(), 0.0
        while lived < self._seconds:
            if due and lived > self._seconds * (0.4 - 0.1 * len(due)):
                what = due.pop(0)
            else:
                what = list(happenings)[self._rng.choice(len(happenings), p=[*happenings.values()])]
            self._befell[what()] += 1
            time.sleep(self._rng.uniform(*_PAUSES))
            self._look()
            now = self._clock()
            lived, last = lived + max(0.0, now - last), now
            if lived - told > self._seconds / 12:
                told = lived
                console.print(
                    f"{lived:.0f} s: {self._total()} decisions, {self._befell.total()} faults"
                )
        self._end(signal.SIGTERM)
        return self._text()

    def _started(self) -> Controller:
        controller = self._bench.controller(
            self._map,
            planner="reactive",
            commands=0,
            after_collision="back-off",
            learn=True,
            save_every=1,
            wait=inf,
            recovery=inf,
            trouble="clock jumps",
        )
        self._kept = _learned(self._map)
        self._since = time.monotonic()
        self._live("controller")
        return controller

    def _live(self, name: str) -> None:
        self._lives.append(Life(name, []))

    def _look(self) -> None:
        """Measure both processes, and see that they are there and that decisions go on."""
        for name, process in (
            ("controller", self._controller.process),
            ("emulator", self._bench.emulator.process),
        ):
            if process.poll() is not None:
                raise SystemExit(f"the {name} ended by itself: {self._controller.lines[-3:]}")
            life = next(each for each in reversed(self._lives) if each.name == name)
            life.uses.append(use_of(process.pid))
        times = [self._since, *self._controller.times]
        silence = time.monotonic() - times[-1]
        gaps = [b - a for a, b in pairwise(times)]
        self._longest = max(self._longest, silence, *gaps[-20:], 0.0)
        if silence > _SILENT:
            raise SystemExit(f"no decision for {silence:.0f} s: {self._controller.lines[-3:]}")

    def _end(self, number: int) -> None:
        """End the controller, and see that it has kept what it has learned."""
        controller = self._controller
        os.kill(controller.process.pid, number)
        said = controller.end()
        steps = controller.steps()
        self._steps += steps
        lost = steps - (_learned(self._map) - self._kept)
        self._lost.append(lost)
        self._ended[said.rpartition(" ")[0] or "killed"] += 1
        # a killed one may have told a decision that it was about to keep
        if lost > (number == signal.SIGKILL):
            raise SystemExit(f"{lost} of {steps} commands were learned and lost")

    def _total(self) -> int:
        return self._steps + self._controller.steps()

    def _clock(self) -> float:
        """Read the robot's clock, even while the emulator is stopped."""
        while True:
            with suppress(BenchError):
                now: float = self._bench.truth()[0]
                return now

    def _blind(self) -> str:
        relay: Any = self._bench.relay
        relay.mode = str(self._rng.choice(_CAMERA))
        what = f"camera {relay.mode}"
        time.sleep(self._rng.uniform(0.2, 1.5))
        relay.mode = "pass"
        return what

    def _part(self) -> str:
        """Take the Zenoh session of the camera away for a while; another one takes its place."""
        self._bench.leave_zenoh()
        time.sleep(self._rng.uniform(0.2, 3.0))
        self._bench.join_zenoh()
        return "Zenoh session of the camera ended"

    def _freeze(self) -> str:
        pid = self._bench.emulator.process.pid
        os.kill(pid, signal.SIGSTOP)
        time.sleep(self._rng.uniform(0.1, 1.0))
        os.kill(pid, signal.SIGCONT)
        return "emulator stopped"

    def _restart_emulator(self) -> str:
        self._bench.restart_emulator()
        self._live("emulator")
        return "emulator killed and started again"

    def _restart_controller(self) -> str:
        self._end(signal.SIGTERM)
        self._controller = self._started()
        self._await_decision()
        return "controller ended and started again"

    def _kill_controller(self) -> str:
        self._end(signal.SIGKILL)
        self._controller = self._started()
        self._await_decision()
        return "controller killed and started again"

    def _await_decision(self) -> None:
        self._controller.wait_for_steps(1, _SILENT)

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

    def _text(self) -> str:
        befell = ", ".join(f"{count} x {what}" for what, count in sorted(self._befell.items()))
        rows = [_row(name, self._lives) for name in ("controller", "emulator")]
        head = ("process", "lives", "memory", "greatest growth in a life", "descriptors", "threads")
        return (
            f"{self._steps} decisions; the longest time without one was {self._longest:.0f} s."
            f" {self._steps - sum(self._lost)} of {self._steps} commands that were told are in the"
            f" map (a killed controller may have told one more). Beside the faults of the line and"
            f" of the wall clock there were: {befell}.\n\n{table(head, rows)}"
        )


def _learned(path: Path) -> int:
    """Return how many commands that were learned while driving are in a map."""
    return int(load_map(path)[1].get(LIVED, 0))


def _row(name: str, lives: list[Life]) -> tuple[str, ...]:
    """Return the resources of a process in all its lives that were long enough to tell."""
    long = [life.uses for life in lives if life.name == name and len(life.uses) >= 3 * _SETTLED]
    count = sum(life.name == name for life in lives)
    if not long:
        return (name, f"{count}", "all lives were short", "", "", "")
    early = [uses[_SETTLED : 2 * _SETTLED] for uses in long]
    late = [uses[-_SETTLED:] for uses in long]

    def change(place: int) -> list[float]:
        return [
            median(use[place] for use in after) - median(use[place] for use in before)
            for before, after in zip(early, late, strict=True)
        ]

    memory = max(median(use.memory for use in part) for part in late)
    files = [median(use.descriptors for use in part) for part in (early[-1], late[-1])]
    threads = [median(use.threads for use in part) for part in (early[-1], late[-1])]
    return (
        name,
        f"{count}, {len(long)} of them long",
        f"{memory:.1f} MB",
        f"{max(change(0)):.1f} MB",
        f"{files[0]:g} to {files[1]:g}",
        f"{threads[0]:g} to {threads[1]:g}",
    )


if __name__ == "__main__":
    main()
