"""The live service, for `make bench`: a decision's latency, and what watching costs; `--write`.

Emulator and watchers are processes, the controller is this one, to be measured. Drives alone and
with watchers take turns, so that whatever else the machine does hits all alike.
"""

import os
import tempfile
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, nullcontext
from pathlib import Path
from statistics import median
from typing import Final, NamedTuple

from figures import Figure, percentile
from khepera_protocol.zenoh.controller_payloads import Decision
from khepera_protocol.zenoh.payloads import Reset
from page import DOCS, report
from rich.progress import track
from stopwatch import Part
from timeline import Timeline
from watching import Recording, recorder_and_dashboard, subscribers

import macor_hil.runs.run_reporter
from macor_hil.hardware.bench import ZenohBench
from macor_hil.hardware.cameras.checked_camera import CheckedCamera
from macor_hil.hardware.cameras.zenoh_camera import ZenohCamera
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.hardware.khepera import Khepera
from macor_hil.hardware.line.serial_line import Line
from macor_hil.mind.brain import Brain
from macor_hil.mind.planners.expected import Expected
from macor_hil.mind.settings import MindSettings
from macor_hil.runs.demo import DemoSettings, emulator_process
from macor_hil.runs.learning.checkpoints import train_map
from macor_hil.runs.live_run import serve
from macor_hil.runs.options import RunOptions
from macor_hil.runs.training import Schedule
from macor_hil.telemetry.publisher import Publisher
from macor_hil.telemetry.session import open_session

_ROUNDS: Final = 6
_COMMANDS: Final = 14
_WARM: Final = 3
"""First commands of a drive that do not count: watchers are still meeting the controller."""

_ARENA, _SEED = "open-box", 3
_EMULATOR, _CONTROLLER = "tcp/127.0.0.1:17457", "tcp/127.0.0.1:17458"
_HEAD: Final = ("figure", "measured", "against, or made of", "ratio")

_PICTURE, _TELLING = "picture: drawn, sent, decoded", "telling watchers"
_PARTS: Final[tuple[tuple[str, Part], ...]] = (
    (_PICTURE, (ZenohCamera, "grab")),
    ("picture: waited for the camera watch, looked over", (CheckedCamera, "grab")),
    ("seeing: unwrapping, receptive fields", (Brain, "look")),
    ("situation: Fuzzy ART, what eyes tell of floor and sights", (Brain, "perceive")),
    *((_TELLING, (Publisher, name)) for name in ("frame", "decision", "link", "state")),
    (_TELLING, (macor_hil.runs.run_reporter, "decision_of")),
    (_TELLING, (macor_hil.runs.run_reporter, "link_of")),
    ("planning", (Expected, "plan")),
    ("setting the speed profile: an exchange on the line", (Khepera, "set_profile")),
)


class Drive(NamedTuple):
    """The measurements of a drive, a value a decision, in seconds; parts by name, all under ""."""

    latencies: list[dict[str, float]]
    periods: list[float]
    work: float
    """Processor time of emulator and controller, a command."""


Audience = Callable[[], AbstractContextManager[None]]


class Service:
    """A live drive on a pseudo-terminal at 9600 baud, alone or watched."""

    def __init__(self, stack: ExitStack) -> None:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        self._map = folder / "map.npz"
        recording = folder / "drive.mcap"
        self.audiences: dict[str, Audience] = {
            "nobody": nullcontext,
            "1 subscriber": lambda: subscribers(_CONTROLLER, 1),
            "50 subscribers, one of them stuck": lambda: subscribers(_CONTROLLER, 50, stuck=True),
            "recorder and dashboard": lambda: recorder_and_dashboard(
                recording, (_CONTROLLER, _EMULATOR)
            ),
        }
        _train(self._map)
        before = _children()
        settings = DemoSettings(self._map, arena=_ARENA, seed=_SEED, emulator=_EMULATOR)
        self._port = stack.enter_context(emulator_process(settings))
        (self._emulator,) = _children() - before
        session = stack.enter_context(open_session([], [_EMULATOR]))
        self._bench = ZenohBench(session, "khepera")

    def drive(self, audience: Audience) -> Drive:
        """Drive before somebody."""
        times: list[float] = []
        work: list[float] = []

        def note(_: Decision) -> None:
            times.append(time.monotonic())
            work.append(time.process_time() + _processor_time(self._emulator))

        timeline = Timeline(
            (CheckedCamera, "grab"), (Line, "_ask"), _PARTS, lambda _, data, *__: data[:1] == b"C"
        )
        with audience(), timeline.watch():
            self._bench.reset(Reset(seed=_SEED))
            serve(self._config(), note)
        periods = [b - a for a, b in zip(times[_WARM:], times[_WARM + 1 :], strict=False)]
        a_command = (work[-1] - work[_WARM]) / (len(work) - 1 - _WARM)
        return Drive(timeline.found[_WARM:], periods, a_command)

    def _config(self) -> RunOptions:
        return RunOptions(
            port=self._port,
            map_file=self._map,
            planner="expected",
            commands=_COMMANDS,
            listen=(_CONTROLLER,),
            connect=(_EMULATOR,),
        )


def main() -> None:
    """Measure, and print the table; with `--write` put it into docs/benchmarks.md, too."""
    with ExitStack() as stack:
        recording, service = Recording(stack), Service(stack)
        drives: dict[str, list[Drive]] = {name: [] for name in service.audiences}
        recorded = []
        for _ in track(range(_ROUNDS), "rounds", transient=True):
            for name, audience in service.audiences.items():
                drives[name].append(service.drive(audience))
            recorded.append(recording.round())
    medians = {name: median(each[name] for each in recorded) for name in recorded[0]}
    figures = [*latency_figures(drives), *watching_figures(drives), *recording.figures(medians)]
    load = f"{os.cpu_count()} cores, load average {os.getloadavg()[1]:.1f}."
    report("the live service", _HEAD, figures, (DOCS / "benchmarks.md", "service"), load)


def latency_figures(drives: dict[str, list[Drive]]) -> list[Figure]:
    """Measure a decision and its parts with nobody watching, then with others."""
    alone = [each for drive in drives["nobody"] for each in drive.latencies]
    whole = [each[""] for each in alone]
    figures = [
        Figure(
            "a live decision, picture asked for to drive request sent: median, 99th percentile",
            _both(whole),
            f"{len(whole)} decisions, nobody watching",
            "1",
        )
    ]
    names = list(dict.fromkeys(name for name, _ in _PARTS))
    parts = {name: [each.get(name, 0.0) for each in alone] for name in names}
    parts["rest"] = [2 * each[""] - sum(each.values()) for each in alone]
    for name, values in parts.items():
        share = f"{100 * sum(values) / sum(whole):.1f} %"
        figures.append(Figure(f"of it: {name}", _both(values), "the decision", share))
    baseline = [each[""] - each.get(_PICTURE, 0.0) for each in alone]
    for name, watched in drives.items():
        values = [d[""] - d.get(_PICTURE, 0.0) for drive in watched for d in drive.latencies]
        ratio = f"{median(values) / median(baseline):.2f}"
        what = f"picture at hand to drive request sent; watching: {name}"
        figures.append(Figure(what, _both(values), "nobody watching", ratio))
    return figures


def watching_figures(drives: dict[str, list[Drive]]) -> list[Figure]:
    """Measure what a recorder and a dashboard add to a command, in the loop and beside it."""
    alone, watched = drives["nobody"], drives["recorder and dashboard"]
    pairs = list(zip(alone, watched, strict=True))
    command = median(median(drive.periods) for drive in alone)
    added = median(median(b.periods) - median(a.periods) for a, b in pairs)
    work = median(b.work - a.work for a, b in pairs)
    telling = [
        median(each.get(_TELLING, 0.0) for drive in some for each in drive.latencies)
        for some in (alone, watched)
    ]
    rows = (
        ("a live command takes longer with recorder and dashboard", added),
        ("of it: told by the controller's loop itself", telling[1] - telling[0]),
        ("processor time that both add to emulator and controller", work),
    )
    return [
        Figure(
            name, f"{1e3 * t:+.2f} ms", f"the command {1e3 * command:.0f} ms", _percent(t, command)
        )
        for name, t in rows
    ]


def _both(seconds: list[float]) -> str:
    return f"{1e3 * median(seconds):.1f} ms, {1e3 * percentile(seconds):.1f} ms"


def _percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:+.2f} %"


def _children() -> set[int]:
    """Return the processes that this one started."""
    tasks = Path("/proc/self/task").iterdir()
    return {int(pid) for task in tasks for pid in (task / "children").read_text().split()}


def _processor_time(pid: int) -> float:
    """Seconds of the processor that a process has taken, to 10 ms."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _train(path: Path) -> None:
    port = f"khepera://{_ARENA}?seed={_SEED}"
    schedule = Schedule(tuning=20, random=200, reactive=0)
    with open_hardware(port) as hardware:
        driven = (Driver(hardware.robot), hardware.camera, hardware.bench)
        train_map(path, MindSettings(), schedule, port, driven, lambda _: None)


if __name__ == "__main__":
    main()
