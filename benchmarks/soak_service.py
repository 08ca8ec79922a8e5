"""`make soak-service`: service under random faults, in scaled time; for docs/safety.md.

    PYTHONPATH=tests python benchmarks/soak_service.py [--hours H] [--speed S] [--write]

Emulator, controller, Zenoh router and dashboard are processes. The emulated robot lives a hundred
times faster than a real one, and so does the clock by which the controller times its drives: a
command takes milliseconds. What the machine itself does takes its real time: replies on the line
are waited for as ever, pictures come over Zenoh, maps are written. The controller waits, backs off,
learns on and never gives up. Line and robot have all of their faults by chance; the wall clock of
the controller is set anew again and again; camera, Zenoh sessions, router, emulator and watchers
get their faults from here. Now and then each process is killed, or told to end, and started again,
as a supervisor does. What is asked: decisions go on, nothing that was learned is lost, memory and
descriptors of all stay flat. A week is `--hours 168`; SIGTERM ends it earlier, with its report.
"""

import json
import os
import re
import signal
import time
from argparse import ArgumentParser
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import partial
from itertools import pairwise
from math import inf
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np
from drives import MACOR_HIL
from page import DOCS, table, write_part
from rich.console import Console
from rig import Controller, Rig, rig
from short_training import train_shortly
from websockets.sync.client import connect

from macor_hil.errors import BenchError
from macor_hil.mind.map_file import load_map
from macor_hil.runs.learning.learning_on import LIVED
from macor_hil.telemetry.feed import Feed
from macor_hil.telemetry.session import open_session

_SPEED: Final = 100.0
_HOURS: Final = 10.0
_HOUR: Final = 3600.0
_SEED: Final = 1
_SETTLED: Final = 20
"""Looks at a process after which what is loaded late has been loaded."""

_PAUSES: Final = (0.5, 3.0)
"""Seconds from one thing that befalls to the next."""

_FAULTS: Final = {
    **dict.fromkeys(("drop", "flip", "duplicate"), "p=0.00001"),
    "delay": "p=0.00001,time=HALF",
    **dict.fromkeys(("truncate", "stray"), "p=0.0001"),
    **dict.fromkeys(("stall", "cut"), "p=0.00003,for=SECOND"),
    "reset": "p=0.00003",
    **dict.fromkeys(("dead-sensor", "dirty-sensor"), "p=0.00001,for=SECOND"),
    **dict.fromkeys(("weak-motor", "jammed-motor"), "p=0.00001,for=SECOND"),
    **dict.fromkeys(("frozen-camera", "dark-camera"), "p=0.00001,for=SECOND"),
}
"""Of the line, for each byte, reply or request, and of the robot, for each request. A second of the
machine's time is many on the robot's clock."""

_FAULT_TOLD: Final = re.compile(r"fault at [^:]*: ([a-z-]+):")
_SILENT: Final = 120.0
"""Seconds without a decision after which the service has failed."""

_SAVE_EVERY: Final = 50
"""Commands that a killed controller may lose: the default."""

_CAMERA: Final = ("lost", "frozen", "late", "dark", "small", "garbage")


class Use(NamedTuple):
    """The resources of a process: resident memory in MB, open descriptors, threads."""

    memory: float
    descriptors: int
    threads: int


def use_of(pid: int) -> Use:
    """Return the resources of a process now; one that has ended has no memory."""
    status = Path(f"/proc/{pid}/status").read_text()
    facts = dict(line.split(":", 1) for line in status.splitlines())
    memory = int(facts.get("VmRSS", "0").split()[0]) / 1024
    return Use(memory, len(list(Path(f"/proc/{pid}/fd").iterdir())), int(facts["Threads"]))


def main() -> None:
    """Run for so long and print what came of it; `--write` puts it into docs/safety.md, too."""
    parser = ArgumentParser()
    parser.add_argument("--hours", type=float, default=_HOURS)
    parser.add_argument("--speed", type=float, default=_SPEED)
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    console = Console()
    times = {"HALF": f"{0.5 * given.speed:g}", "SECOND": f"{given.speed:g}"}
    options = []
    for kind, how in _FAULTS.items():
        options += ["--fault", f"{kind}:{re.sub('[A-Z]+', lambda word: times[word[0]], how)}"]
    with TemporaryDirectory() as folder:
        told = Path(folder) / "emulator.log"
        options += ["--speed", f"{given.speed:g}", "--log-level", "info"]
        with rig(folder, *options, relay=True, routed=True, log=told) as bench:
            trained = train_shortly(Path(folder) / "map.npz")
            soak = Soak(bench, trained, given.hours * _HOUR, given.speed)
            try:
                text = soak.run(console)
            except (SystemExit, AssertionError):
                console.print(soak.report())
                raise
        faults_told = Counter(_FAULT_TOLD.findall(told.read_text()))
    of_itself = ", ".join(f"{count} x {kind}" for kind, count in sorted(faults_told.items()))
    text = text.replace("FAULTS", of_itself)
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
        bench: emulator, camera and router.
        trained: map that is driven by, and learned on.
        seconds: of the robot's time.
        speed: how many times faster that passes.
    """

    def __init__(self, bench: Rig, trained: Path, seconds: float, speed: float) -> None:
        assert bench.router is not None
        self._bench = bench
        self._router = bench.router
        self._map = trained
        self._seconds = seconds
        self._speed = speed
        self._rng = np.random.default_rng(_SEED)
        self._befell: Counter[str] = Counter()
        self._lives: list[Life] = []
        self._steps = 0
        self._lost: list[int] = []
        self._longest = 0.0
        self._lived = 0.0
        self._controller = self._started()
        self._dashboard = self._shown()
        for name in ("emulator", "router"):
            self._live(name)

    def run(self, console: Console) -> str:
        """Run, and return the report of it.

        Raises:
            SystemExit: a process ended by itself, decisions stopped, or something learned was lost.
        """
        self._controller.wait_for_steps(1)
        restarts: list[Callable[[], str]] = [
            partial(self._restart_controller, signal.SIGTERM, "ended"),
            partial(self._restart_controller, signal.SIGKILL, "killed"),
            self._restart_emulator,
            self._restart_router,
            partial(self._restart_dashboard, signal.SIGTERM, "ended"),
            partial(self._restart_dashboard, signal.SIGKILL, "killed"),
        ]
        happenings: dict[Callable[[], str], float] = {
            self._blind: 0.40,
            self._watch: 0.25,
            self._part: 0.14,
            self._freeze_emulator: 0.10,
            self._freeze_controller: 0.05,
            self._browse: 0.048,
            **dict.fromkeys(restarts, 0.002),
        }
        # each of them once at least, and early: what lives long is to be seen, too
        due = list(restarts)
        last, told = self._clock(), 0.0
        asked: list[int] = []
        signal.signal(signal.SIGTERM, lambda number, _: asked.append(number))
        while self._lived < self._seconds and not asked:
            if due and self._lived > self._seconds * 0.4 * (1 - len(due) / len(restarts)):
                what = due.pop(0)
            else:
                what = list(happenings)[self._rng.choice(len(happenings), p=[*happenings.values()])]
            self._befell[what()] += 1
            time.sleep(self._rng.uniform(*_PAUSES))
            self._look()
            now = self._clock()
            self._lived, last = self._lived + max(0.0, now - last), now
            if self._lived - told > self._seconds / 24:
                told = self._lived
                used = ", ".join(
                    f"{name} {self._life(name).uses[-1].memory:.0f} MB" for name in self._names()
                )
                console.print(
                    f"{self._lived / _HOUR:.1f} h: {self._total()} decisions,"
                    f" {self._befell.total()} faults; {used}"
                )
        self._end(signal.SIGTERM)
        return self.report()

    def _started(self) -> Controller:
        controller = self._bench.controller(
            self._map,
            planner="reactive",
            commands=0,
            after_collision="back-off",
            learn=True,
            save_every=_SAVE_EVERY,
            wait=inf,
            recovery=inf,
            trouble="clock jumps",
            hurry=self._speed,
        )
        self._kept = _learned(self._map)
        self._since = time.monotonic()
        self._live("controller")
        return controller

    def _shown(self) -> Controller:
        """Start a dashboard."""
        where = ["--port", "0", "--connect", self._router.endpoint]
        dashboard = self._bench.start([*MACOR_HIL, "dashboard", *where])
        dashboard.wait_for(lambda lines: bool(lines), _SILENT)
        self._live("dashboard")
        return dashboard

    def _names(self) -> list[str]:
        return sorted({life.name for life in self._lives})

    def _live(self, name: str) -> None:
        self._lives.append(Life(name, []))

    def _life(self, name: str) -> Life:
        """Return the present life of a process."""
        return next(each for each in reversed(self._lives) if each.name == name)

    def _look(self) -> None:
        """Measure the processes, and see that they are there and that decisions go on."""
        for name, process in (
            ("controller", self._controller.process),
            ("emulator", self._bench.emulator.process),
            ("router", self._router.process),
            ("dashboard", self._dashboard.process),
        ):
            use = use_of(process.pid)
            if not use.memory:
                status = process.wait()
                said = str(process.stderr.read()) if process.stderr else ""
                said += self._bench.log.read_text()[-1000:] if self._bench.log else ""
                raise SystemExit(
                    f"the {name} ended by itself with {status}: {said}"
                    f" {self._controller.lines[-3:]}, {self._dashboard.lines[-3:]}"
                )
            self._life(name).uses.append(use)
        times = [self._since, *self._controller.times[-20:]]
        silence = time.monotonic() - times[-1]
        gaps = [b - a for a, b in pairwise(times[1:])]
        self._longest = max(self._longest, silence, *gaps, 0.0)
        if silence > _SILENT:
            raise SystemExit(f"no decision for {silence:.0f} s: {self._controller.lines[-3:]}")

    def _end(self, number: int) -> None:
        """End the controller, and see that it has kept what it has learned."""
        controller = self._controller
        os.kill(controller.process.pid, number)
        controller.end()
        steps = controller.steps()
        self._steps += steps
        lost = steps - (_learned(self._map) - self._kept)
        self._lost.append(lost)
        # a killed one loses what it has not yet written, and the decision that it is about to count
        if lost > (_SAVE_EVERY if number == signal.SIGKILL else 0):
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

    def _freeze_emulator(self) -> str:
        return self._freeze("emulator", self._bench.emulator.process.pid)

    def _freeze_controller(self) -> str:
        return self._freeze("controller", self._controller.process.pid)

    def _freeze(self, name: str, pid: int) -> str:
        os.kill(pid, signal.SIGSTOP)
        time.sleep(self._rng.uniform(0.1, 1.0))
        os.kill(pid, signal.SIGCONT)
        return f"{name} stopped"

    def _restart_emulator(self) -> str:
        self._bench.restart_emulator()
        self._live("emulator")
        return "emulator killed and started again"

    def _restart_router(self) -> str:
        self._router.kill()
        time.sleep(self._rng.uniform(0.2, 3.0))
        self._router.start()
        self._live("router")
        return "router killed and started again"

    def _restart_controller(self, number: int, word: str) -> str:
        self._end(number)
        self._controller = self._started()
        self._await_decision()
        return f"controller {word} and started again"

    def _restart_dashboard(self, number: int, word: str) -> str:
        os.kill(self._dashboard.process.pid, number)
        self._dashboard.end()
        self._dashboard = self._shown()
        return f"dashboard {word} and started again"

    def _browse(self) -> str:
        """Let a browser look at the dashboard for a while, and go."""
        address = str(self._dashboard.lines[0]).replace("http", "ws", 1).rstrip("/")
        with connect(f"{address}/live", open_timeout=_SILENT, close_timeout=1.0) as page:
            page.send(json.dumps({}))
            assert json.loads(page.recv(_SILENT))["parts"]
            time.sleep(self._rng.uniform(0.0, 2.0))
        return "browser"

    def _await_decision(self) -> None:
        self._controller.wait_for_steps(1, _SILENT)

    def _watch(self) -> str:
        """Let some watchers come, look for a while or not at all, and go."""
        with ExitStack() as stack:
            for _ in range(int(self._rng.integers(1, 4))):
                session = stack.enter_context(open_session([], [self._router.endpoint]))
                feed = stack.enter_context(Feed(session, "khepera", camera=True))
                end = time.monotonic() + self._rng.uniform(0.0, 0.7)
                while time.monotonic() < end:
                    feed.get(0.1)
        return "watchers"

    def report(self) -> str:
        """Return what came of it so far; FAULTS stands for those of line and robot."""
        befell = ", ".join(f"{count} x {what}" for what, count in sorted(self._befell.items()))
        rows = [_row(name, self._lives) for name in self._names()]
        head = ("process", "lives", "memory", "greatest growth in a life", "descriptors", "threads")
        kept = self._steps - sum(self._lost)
        return (
            f"{self._lived / _HOUR:.0f} h of the robot, {self._speed:g} times faster."
            f" {self._steps} decisions; the longest time without one was {self._longest:.0f} s."
            f" {kept} of {self._steps} commands that were told are in the map; those that are not"
            f" had not been written when the controller was killed. Faults of the line and of the"
            f" robot: FAULTS. From outside: {befell}.\n\n{table(head, rows)}"
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
