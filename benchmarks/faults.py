"""`make faults`: what befalls a live run, and what becomes of it; the table of docs/safety.md.

Everything is a process: emulator on a terminal, camera relay, controller. Times are on the
emulator's own clock. The machine's other programs show in them.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from page import DOCS, table, write_part
from rich.console import Console
from rich.table import Table
from rig import Rig, rig

from macor_hil.brain import Brain, Settings
from macor_hil.checkpoints import checkpoint_path
from macor_hil.drive import Driver
from macor_hil.errors import BenchError
from macor_hil.hardware import open_hardware
from macor_hil.map_file import load_map, save_map
from macor_hil.training import Schedule, Trainer

_HEAD = ("fault", "robot stood within", "driving again within", "commands lost", "run")
_LINE = {
    "drop: one byte in 200 lost": "drop:p=0.005,at=15,for=15",
    "flip: one byte in 200 bent": "flip:p=0.005,at=15,for=15",
    "duplicate: one byte in 200 comes twice": "duplicate:p=0.005,at=15,for=15",
    "delay: one byte in 200 late by 0.3 s": "delay:p=0.005,time=0.3,at=15,for=15",
    "truncate: one reply in 20 cut": "truncate:p=0.05,at=15,for=15",
    "stray: one reply in 20 after a foreign line": "stray:p=0.05,at=15,for=15",
    "stall: the line stands still for 1 s": "stall:at=20,for=1",
    "cut: nothing gets through for 2 s": "cut:at=20,for=2",
    "reset of the robot": "reset:at=20",
}
_LINE_SECONDS = 32.0


def main() -> None:
    """Run all faults and print the table; `--write` puts it into docs/safety.md, too."""
    console = Console()
    rows: list[tuple[str, ...]] = []
    with TemporaryDirectory() as folder:
        trained = _train(Path(folder) / "map.npz")
        for name, fault in _LINE.items():
            rows.append(_shown(console, (name, *_line_fault(Path(folder), trained, fault))))
        with rig(folder) as bench:
            for name, act in _EVENTS.items():
                bench.make_ready()
                rows.append(_shown(console, (name, *act(bench, trained))))
        rows.append(_shown(console, ("training: controller killed", *_killed_training(folder))))
        rows.append(_shown(console, ("training: disk full", *_full_disk(folder))))
    shown = Table(*_HEAD, title="faults")
    for row in rows:
        shown.add_row(*row)
    console.print(shown)
    if "--write" in sys.argv[1:]:
        write_part(DOCS / "safety.md", "faults", table(_HEAD, rows))


def _shown(console: Console, row: tuple[str, ...]) -> tuple[str, ...]:
    console.print(" | ".join(row))
    return row


def _train(path: Path) -> Path:
    schedule = Schedule(tuning=15, random=60, reactive=0, session=60)
    with open_hardware("khepera://open-box?seed=1&drift=none") as hardware:
        brain = Brain(Settings())
        trainer = Trainer(brain, Driver(hardware.robot), hardware.camera, hardware.bench, schedule)
        for session in schedule.sessions():
            trainer.run(session, lambda _: None)
    save_map(path, brain, {})
    return path


def _end(controller: Any) -> tuple[str, str]:
    """Commands lost, and what became of the run."""
    if controller.process.poll() is None:
        controller.process.terminate()
    said = controller.end()
    lost = said.rsplit(maxsplit=1)[-1] if said.startswith("interrupted") else "-"
    return lost, "went on" if said.startswith("interrupted") else said[:60]


def _line_fault(folder: Path, trained: Path, fault: str) -> tuple[str, ...]:
    with rig(folder, "--fault", fault) as bench:
        bench.make_ready()  # the fault's times count from here
        controller = bench.controller(trained)
        start = time.monotonic()
        with suppress(AssertionError):
            while time.monotonic() - start < _LINE_SECONDS:
                controller.wait_for_steps(1, _LINE_SECONDS)
        # the longest time without a command is what the fault cost
        return "between commands", f"{_longest_gap(controller):.1f} s", *_end(controller)


def _longest_gap(controller: Any) -> float:
    times = [when for line, when in zip(controller.lines, controller.times, strict=False) if line]
    return max((b - a for a, b in pairwise(times)), default=0.0)


def _event(
    act: Callable[[Rig], None], undo: Callable[[Rig], None] = lambda _: None, **fields: Any
) -> Callable[[Rig, Path], tuple[str, ...]]:
    def run(bench: Rig, trained: Path) -> tuple[str, ...]:
        controller = bench.controller(trained, speed=2, **fields)
        controller.wait_for_steps(1)
        bench.wait_until_moving()
        act(bench)
        try:
            stood = f"{bench.time_to_stand():.2f} s"
        except BenchError:
            stood = "the emulator was gone"
        undo(bench)
        begin = time.monotonic()
        controller.wait_for_steps(1)
        again = f"{time.monotonic() - begin:.1f} s"
        return stood, again, *_end(controller)

    return run


def _camera(mode: str) -> Callable[[Rig, Path], tuple[str, ...]]:
    def act(bench: Rig) -> None:
        assert bench.relay is not None
        bench.relay.mode = mode

    def undo(bench: Rig) -> None:
        assert bench.relay is not None
        bench.relay.mode = "pass"

    return _event(act, undo)


def _ending(number: signal.Signals) -> Callable[[Rig, Path], tuple[str, ...]]:
    """The controller is ended, and another one started."""

    def run(bench: Rig, trained: Path) -> tuple[str, ...]:
        controller = bench.controller(trained, speed=2)
        controller.wait_for_steps(1)
        bench.wait_until_moving()
        os.kill(controller.process.pid, number)
        stood = f"{bench.time_to_stand():.2f} s"
        controller.end()
        begin = time.monotonic()
        other = bench.controller(trained, speed=2)
        other.wait_for_steps(1)
        return stood, f"{time.monotonic() - begin:.1f} s", "1", _end(other)[1]

    return run


def _clock_jump(bench: Rig, trained: Path) -> tuple[str, ...]:
    controller = bench.controller(trained, trouble="clock jump")
    controller.wait_for(lambda lines: "jump" in lines)
    controller.wait_for_steps(3)
    return "does not notice", "at once", *_end(controller)


_EVENTS: dict[str, Callable[[Rig, Path], tuple[str, ...]]] = {
    **{f"camera {mode}": _camera(mode) for mode in ("lost", "frozen", "late", "dark", "small")},
    "camera sends garbage": _camera("garbage"),
    "emulator killed and restarted": _event(lambda bench: bench.restart_emulator()),
    "emulator stopped for 2 s (SIGSTOP)": _event(
        lambda bench: _freeze(bench.emulator.process.pid, 2.0)
    ),
    "controller: Ctrl-C, started again": _ending(signal.SIGINT),
    "controller: SIGTERM, started again": _ending(signal.SIGTERM),
    "controller: SIGKILL, started again": _ending(signal.SIGKILL),
    "the wall clock jumps by an hour": _clock_jump,
}


def _freeze(pid: int, seconds: float) -> None:
    os.kill(pid, signal.SIGSTOP)
    time.sleep(seconds)
    os.kill(pid, signal.SIGCONT)


_TRAINING = """
import json, resource, sys
from pathlib import Path
from macor_hil.brain import Settings
from macor_hil.caretaker import Caretaker
from macor_hil.checkpoints import train_map
from macor_hil.drive import Driver
from macor_hil.errors import MacorError
from macor_hil.hardware import open_hardware
from macor_hil.training import Recovery, Schedule
path, limit = Path(sys.argv[1]), int(sys.argv[2])
schedule = Schedule(tuning=15, random=80, reactive=0, session=40, recovery=Recovery.BACK)
with open_hardware("khepera://open-box?seed=1") as hardware:
    def progress(done):
        print(done, flush=True)
        if limit and done == 40:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    devices = Driver(hardware.robot), hardware.camera, None
    try:
        train_map(path, Settings(), schedule, "x", devices, progress,
                  Caretaker(hardware.robot, hardware.camera), 1)
    except MacorError as error:
        print(f"ended: {error}", flush=True)
"""


def _training(path: Path, limit: int, kill_at: int | None) -> tuple[int, str]:
    """Commands driven when it ended, and the last words."""
    command = [sys.executable, "-c", _TRAINING, str(path), str(limit)]
    driven, words = 0, ""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.strip().isdecimal():
                driven = int(line)
                if driven == kill_at:
                    process.kill()
            elif line.startswith("ended"):
                words = line.strip()
    return driven, words


def _kept(path: Path) -> int:
    brain, _ = load_map(checkpoint_path(path))
    return 15 + int(brain.map.transitions().z.sum())


def _killed_training(folder: str) -> tuple[str, ...]:
    path = Path(folder) / "killed.npz"
    _training(path, 0, kill_at=50)
    lost = max(0, 50 - _kept(path))
    _training(path, 0, None)
    whole = int(load_map(path)[0].map.transitions().z.sum())
    return "end of its command", "at once", str(lost), f"went on to all {whole} transitions"


def _full_disk(folder: str) -> tuple[str, ...]:
    path = Path(folder) / "full.npz"
    driven, words = _training(path, 100, None)
    lost = max(0, driven - _kept(path))
    _training(path, 0, None)
    whole = int(load_map(path)[0].map.transitions().z.sum())
    how = "ended with an error" if words else "ended without a word"
    return "at once", "when there is room", str(lost), f"{how}; then on to all {whole} transitions"


if __name__ == "__main__":
    main()
