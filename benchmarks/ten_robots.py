"""Ten robots in one emulator and their ten controllers, each a process, on this machine.

    python benchmarks/ten_robots.py runs/corridor.npz [--robots N] [--seconds S] [--write]

The line of each robot is as slow as a real one (9600 baud); the figures are those that the
controllers tell Prometheus. What is asked: how many decisions each makes, how long the robots'
replies take, and what the processes use of the machine.
"""

import os
import subprocess
import sys
import time
import urllib.request
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from page import DOCS, table, write_part
from prometheus_client.parser import text_string_to_metric_families

_METRICS: Final = 9101
_ENDPOINT: Final = 7501
_STARTING: Final = 120.0
_CLOCK: Final = os.sysconf("SC_CLK_TCK")
_EMULATOR: Final = "khepera_emulator.app.cli"
_CONTROLLER: Final = "macor_hil.cli"

Values = dict[str, float]


def main() -> None:
    """Start them, measure, and print a table."""
    parser = ArgumentParser()
    parser.add_argument("map", type=Path)
    parser.add_argument("--robots", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    with TemporaryDirectory() as folder, ExitStack() as stack:
        emulator, controllers = _started(stack, Path(folder), given)
        _await_decisions(given.robots)
        load = os.getloadavg()[0]
        before = [_read(k) for k in range(given.robots)]
        used = [_processor(emulator), *map(_processor, controllers)]
        begun = time.monotonic()
        time.sleep(given.seconds)
        seconds = time.monotonic() - begun
        after = [_read(k) for k in range(given.robots)]
        spent = [
            now - was
            for now, was in zip(
                [_processor(emulator), *map(_processor, controllers)], used, strict=True
            )
        ]
        memory = [_memory(emulator), *map(_memory, controllers)]
    text = _text(before, after, spent, memory, seconds, load)
    sys.stdout.write(text + "\n")
    if given.write:
        write_part(DOCS / "service.md", "ten robots", text)


def _started(stack: ExitStack, folder: Path, given: Namespace) -> tuple[int, list[int]]:
    """Start the emulator and the controllers; returns their numbers."""
    link = folder / "khepera"
    robots = ("--robots", str(given.robots), "--arena", "open-box", "--link", str(link))
    emulator = stack.enter_context(_process(_EMULATOR, "run", *robots))
    controllers = []
    for k in range(given.robots):
        place = ("--robot", f"khepera-{k + 1}", "--port", f"{link}-{k + 1}", "--camera", "zenoh")
        told = ("--listen", f"tcp/127.0.0.1:{_ENDPOINT + k}", "--metrics-port", str(_METRICS + k))
        for_ever = ("--commands", "0", "--after-collision", "back-off")
        patient = ("--wait", "inf", "--recovery", "inf")
        drive = ("--quiet", "--map", str(given.map), "--planner", "graded")
        controllers.append(
            stack.enter_context(
                _process(_CONTROLLER, "run", *place, *told, *for_ever, *patient, *drive)
            )
        )
    return emulator, controllers


@contextmanager
def _process(module: str, *arguments: str) -> Iterator[int]:
    command = [sys.executable, "-m", module, *arguments]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            yield process.pid
        finally:
            process.terminate()


def _await_decisions(robots: int) -> None:
    """Wait until each has decided twice."""
    end = time.monotonic() + _STARTING
    for k in range(robots):
        while True:
            try:
                if _read(k)["macor_decisions_total"] >= 2:
                    break
            except OSError:
                pass  # not there yet
            if time.monotonic() > end:
                raise SystemExit(f"the controller of robot {k + 1} does not drive")
            time.sleep(0.5)


def _read(k: int) -> Values:
    with urllib.request.urlopen(f"http://127.0.0.1:{_METRICS + k}/metrics") as answer:
        families: Any = text_string_to_metric_families(answer.read().decode())
        return {
            sample.name + sample.labels.get("le", ""): sample.value
            for family in families
            for sample in family.samples
        }


def _processor(pid: int) -> float:
    """Seconds of processor that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _CLOCK


def _memory(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    facts = dict(line.split(":", 1) for line in status.splitlines())
    return int(facts["VmRSS"].split()[0]) / 1024


def _text(
    before: list[Values],
    after: list[Values],
    spent: list[float],
    memory: list[float],
    seconds: float,
    load: float,
) -> str:
    def more(name: str) -> list[float]:
        return [now[name] - was[name] for now, was in zip(after, before, strict=True)]

    decisions, collisions = more("macor_decisions_total"), more("macor_collisions_total")
    exchanges = sum(more("macor_exchange_seconds_count"))
    mean = sum(more("macor_exchange_seconds_sum")) / exchanges
    late = exchanges - sum(more("macor_exchange_seconds_bucket0.2"))
    plans = sum(more("macor_planning_seconds_sum")) / sum(more("macor_planning_seconds_count"))
    rows = [
        ("decisions of a robot, a minute", _range([60 * n / seconds for n in decisions])),
        ("collisions, all robots", f"{sum(collisions):.0f}"),
        ("failures recovered from, all robots", f"{sum(more('macor_recoveries_total')):.0f}"),
        ("requests to robots, a second", f"{exchanges / seconds:.0f}"),
        ("a reply, mean", f"{1000 * mean:.0f} ms"),
        ("replies after more than 0.2 s", f"{late:.0f} of {exchanges:.0f}"),
        ("planning, mean", f"{1000 * plans:.1f} ms"),
        ("processor: emulator", f"{100 * spent[0] / seconds:.0f} % of a core"),
        ("processor: a controller", f"{_range([100 * s / seconds for s in spent[1:]])} %"),
        ("memory: emulator", f"{memory[0]:.0f} MB"),
        ("memory: a controller", f"{_range(memory[1:])} MB"),
    ]
    head = f"{len(before)} robots, {seconds:.0f} s, {os.cpu_count()} cores, load {load:.1f} before"
    return f"{head}.\n\n{table(('what', 'measured'), rows)}"


def _range(values: list[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.0f} to {high:.0f}"


if __name__ == "__main__":
    main()
