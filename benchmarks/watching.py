"""What watching costs: samples a recorder writes, and a live drive with and without watchers."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from statistics import median

import cv2
import numpy as np
from figures import Figure

from macor_hil.bench import ZenohBench
from macor_hil.brain import Brain, Settings
from macor_hil.demo import DemoSettings, emulator_process
from macor_hil.drive import Driver
from macor_hil.hardware import open_hardware
from macor_hil.map_file import save_map
from macor_hil.service import ServiceConfig, serve
from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.feed import Arrival
from macor_hil.telemetry.recording import Recorder
from macor_hil.telemetry.schemas import Decision
from macor_hil.telemetry.session import open_session
from macor_hil.training import Schedule, Trainer
from protocol.mirror import Mirror
from protocol.side_channel import Reset, Stamp

_PAIRS = 2000
_COMMANDS = 10
_EMULATOR, _CONTROLLER = "tcp/127.0.0.1:17457", "tcp/127.0.0.1:17458"
_PAGE = 18457
_MEETING = 10.0
"""Seconds that recorder and dashboard may take to appear."""


class Recording:
    """Pairs of a picture and a decision, to a file on this machine's disk."""

    def __init__(self, stack: ExitStack) -> None:
        self._folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        rng = np.random.default_rng(0)
        mirror = Mirror()
        image = rng.integers(90, 130, (mirror.height, mirror.width, 3), dtype=np.uint8)
        self._picture = cv2.imencode(".jpg", image)[1].tobytes()
        self._decision = EXAMPLES[Decision].model_dump_json().encode()

    def round(self) -> dict[str, float]:
        """Write all pairs; pairs a second, and bytes a second."""
        stamp, path = Stamp(sequence=0, time=0.0), self._folder / "bench.mcap"
        pair = [
            Arrival("macor", "frame", self._picture, "image/jpeg", stamp, 0),
            Arrival("macor", "decision", self._decision, "application/json", stamp, 0),
        ]
        start = time.perf_counter()
        with Recorder(path, "khepera") as recorder:
            for _ in range(_PAIRS):
                for event in pair:
                    recorder.write(event)
        taken = time.perf_counter() - start
        return {"pairs": _PAIRS / taken, "bytes": path.stat().st_size / taken}

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """How much faster than a robot that decides 1.3 times a second."""
        return [
            Figure(
                f"recorded pairs of picture ({len(self._picture) / 1000:.1f} kB) and decision/s",
                f"{medians['pairs']:,.0f}",
                f"{medians['bytes'] / 1e6:.0f} MB/s to disk; a robot decides 1.3 times a second",
                f"{medians['pairs'] / 1.3:,.0f} x what is needed",
            )
        ]


class Watched:
    """A live drive on a pseudo-terminal: alone, then with a recorder and a dashboard.

    Programs that share the machine show in the time of a command; what emulator and controller
    do for the watchers shows in the processor time that both take, and slows the loop by no more.
    """

    def __init__(self, stack: ExitStack) -> None:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        self._map = folder / "map.npz"
        self._recording = folder / "drive.mcap"
        _train(self._map)
        before = _children()
        settings = DemoSettings(self._map, folder / "khepera", emulator=_EMULATOR)
        self._port = stack.enter_context(emulator_process(settings))
        (self._emulator,) = _children() - before
        session = stack.enter_context(open_session([], [_EMULATOR]))
        self._bench = ZenohBench(session, "khepera")

    def round(self) -> dict[str, float]:
        """Seconds from one decision to the next, median of a drive; processor time a command."""
        alone, alone_work = self._drive()
        with _watchers(self._recording):
            watched, watched_work = self._drive()
        return {
            "alone": alone,
            "watched": watched,
            "added": watched - alone,
            "alone work": alone_work,
            "watched work": watched_work,
        }

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """The share that watching adds."""
        alone, added = medians["alone"], medians["watched work"] - medians["alone work"]
        return [
            Figure(
                "a live command, recorder and dashboard watching",
                f"{1e3 * medians['watched']:.1f} ms",
                f"nobody watching {1e3 * alone:.1f} ms",
                f"{100 * medians['added'] / alone:+.2f} %",
            ),
            Figure(
                "processor time that watching adds to emulator and controller, a command",
                f"{1e3 * added:.2f} ms",
                f"the command {1e3 * alone:.1f} ms",
                f"{100 * added / alone:+.2f} %",
            ),
        ]

    def _drive(self) -> tuple[float, float]:
        self._bench.reset(Reset(seed=1))
        times: list[float] = []
        work: list[float] = []

        def note(_: Decision) -> None:
            times.append(time.monotonic())
            work.append(time.process_time() + _processor_time(self._emulator))

        config = ServiceConfig(
            port=self._port,
            map_file=self._map,
            planner="expected",
            commands=_COMMANDS,
            listen=(_CONTROLLER,),
            connect=(_EMULATOR,),
        )
        serve(config, note)
        return median(np.diff(times).tolist()), (work[-1] - work[0]) / (len(work) - 1)


def _children() -> set[int]:
    """Processes that this one started."""
    tasks = Path("/proc/self/task").iterdir()
    return {int(pid) for task in tasks for pid in (task / "children").read_text().split()}


def _processor_time(pid: int) -> float:
    """Seconds of the processor that a process has taken, to 10 ms."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _train(path: Path) -> None:
    schedule = Schedule(tuning=20, random=200, reactive=0)
    with open_hardware("khepera://corridor?seed=3") as hardware:
        brain = Brain(Settings())
        trainer = Trainer(brain, Driver(hardware.robot), hardware.camera, hardware.bench, schedule)
        for session in schedule.sessions():
            trainer.run(session, lambda _: None)
    save_map(path, brain, {})


@contextmanager
def _watchers(recording: Path) -> Iterator[None]:
    connect = ["--connect", _CONTROLLER, "--connect", _EMULATOR]
    command = [sys.executable, "-u", "-m", "macor_hil.cli"]
    recorder = [*command, "record", str(recording), *connect]
    dashboard = [*command, "dashboard", "--port", str(_PAGE), *connect]
    with (
        subprocess.Popen(recorder, stdout=subprocess.PIPE) as first,
        subprocess.Popen(dashboard, stdout=subprocess.PIPE, text=True) as second,
    ):
        try:
            assert second.stdout is not None
            second.stdout.readline()
            end = time.monotonic() + _MEETING
            while time.monotonic() < end:
                with suppress(OSError):
                    if recording.stat().st_size > 1000:
                        break
                time.sleep(0.1)
            yield
        finally:
            for process in (first, second):
                process.terminate()
        recording.unlink(missing_ok=True)
