"""Exchanges through the emulator's pseudo-terminal: how many, how late, how exactly in time."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from statistics import median

import serial
from figures import Figure, percentile
from khepera_protocol.serial.units import wire_time

from khepera_emulator.line.dialect import KHEPERA

_EXCHANGES = 3000
_PACED = {9600: 60, 38400: 150, 115200: 300}
"""Rate -> exchanges in one round."""

_DRIVE, _STOP, _REQUEST = b"D,3,-3\n", b"D,0,0\n", b"H\n"
_SENSORS = b"N\n"

Exchange = Callable[[bytes], bytes]


class Client:
    """Two ways of reading replies from one pySerial port."""

    def __init__(self, path: str, rate: int = 9600) -> None:
        self.port = serial.Serial(path, rate, stopbits=serial.STOPBITS_TWO, timeout=5.0)
        self._rest = bytearray()

    def by_line(self, request: bytes) -> bytes:
        """Exchange with pySerial's own readline: a system call or two for each byte."""
        self.port.write(request)
        line: bytes = self.port.readline()
        return line

    def by_chunk(self, request: bytes) -> bytes:
        """Exchange by taking what there is and looking for the line's end in it."""
        port, rest = self.port, self._rest
        port.write(request)
        while (end := rest.find(b"\n")) < 0:
            chunk = port.read(max(1, port.in_waiting))
            if not chunk:
                raise TimeoutError(f"no reply to {request!r}")
            rest += chunk
        line = bytes(rest[: end + 1])
        del rest[: end + 1]
        return line


class Exchanges:
    """Unpaced exchanges with a robot that drives, against a bare pseudo-terminal.

    The bare one answers with as many bytes as the robot does.
    """

    def __init__(self, stack: ExitStack) -> None:
        path, daemon = stack.enter_context(emulator("unpaced"))
        self._robot = Client(path)
        reply = self._robot.by_line(_REQUEST).rstrip().decode()
        bare, echo = stack.enter_context(bare_pty(reply))
        self._bare = Client(bare)
        self._pids = {"robot": daemon, "bare": echo}

    def round(self) -> dict[str, float]:
        """Both clients with both terminals, a quarter at a time in turn."""
        found: dict[str, float] = {}
        self._robot.by_line(_DRIVE)
        before = {name: _processor_time(pid) for name, pid in self._pids.items()}
        for way in ("line", "chunk"):
            times: dict[str, list[float]] = {"robot": [], "bare": []}
            for _ in range(4):
                for name, client in (("robot", self._robot), ("bare", self._bare)):
                    exchange = client.by_line if way == "line" else client.by_chunk
                    times[name] += _latencies(exchange, _EXCHANGES // 4)
            for name, each in times.items():
                found[f"{name} {way} rate"] = len(each) / sum(each)
                found[f"{name} {way} p99"] = percentile(each)
        for name, pid in self._pids.items():
            found[f"{name} cpu"] = (_processor_time(pid) - before[name]) / (2 * _EXCHANGES)
        self._robot.by_line(_STOP)
        # the counters went back and forth to nearly the same: keep the replies' length alike
        self._robot.by_line(b"G,0,0\n")
        return found

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """Exchanges a second and 99th percentiles."""
        rows = []
        for way, title in (("line", "readline"), ("chunk", "chunks")):
            robot, bare = (medians[f"{name} {way} rate"] for name in ("robot", "bare"))
            rows.append(
                Figure(
                    f"exchanges/s, unpaced, client reads {title}",
                    f"{robot:,.0f}",
                    f"bare pty {bare:,.0f}",
                    f"{robot / bare:.2f}",
                )
            )
        robot, bare = (1e6 * medians[f"{name} cpu"] for name in ("robot", "bare"))
        rows.append(
            Figure(
                "processor time of the emulator's process, an exchange",
                f"{robot:.0f} us",
                f"bare pty's process {bare:.0f} us",
                f"{robot / bare:.2f}",
            )
        )
        for way, title in (("line", "readline"), ("chunk", "chunks")):
            robot, bare = (1e6 * medians[f"{name} {way} p99"] for name in ("robot", "bare"))
            rows.append(
                Figure(
                    f"99th percentile of an exchange, client reads {title}",
                    f"{robot:.0f} us",
                    f"bare pty {bare:.0f} us",
                    f"{robot / bare:.2f}",
                )
            )
        return rows


class WireTime:
    """Error of the moment at which the last byte of a reply is there, at real rates.

    The ideal: every byte of request and reply takes 11 bit times, the interpreter 1.5 ms between.
    Held against a bare pseudo-terminal that sleeps for that time and answers: what the system's
    sleeps, wake-ups and terminals are late by themselves.
    """

    def __init__(self, stack: ExitStack) -> None:
        path, _ = stack.enter_context(emulator("auto"))
        self._robot = Client(path)
        reply = self._robot.by_chunk(_SENSORS).rstrip().decode()
        bare, _ = stack.enter_context(bare_pty(reply))
        self._bare = Client(bare)
        self._errors: dict[tuple[str, int], list[float]] = {
            (name, rate): [] for name in ("robot", "bare") for rate in _PACED
        }
        self._ideals: dict[int, float] = {}

    def round(self) -> dict[str, float]:
        """All rates, the robot and the bare terminal in turn."""
        clock = time.perf_counter
        for rate, exchanges in _PACED.items():
            self._robot.port.baudrate = rate
            for _ in range(exchanges):
                start = clock()
                reply = self._robot.by_chunk(_SENSORS)
                taken = clock() - start
                ideal = wire_time(len(_SENSORS) + len(reply), rate) + KHEPERA.busy
                self._errors["robot", rate].append(taken - ideal)
                self._ideals[rate] = ideal
                wait = f"{ideal:.6f}\n".encode()
                start = clock()
                self._bare.by_chunk(wait)
                self._errors["bare", rate].append(clock() - start - ideal)
        return {}

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:  # noqa: ARG002 - all rounds count
        """Percentiles over all rounds."""
        rows = []
        for rate, ideal in self._ideals.items():
            robot, bare = (self._spread(name, rate) for name in ("robot", "bare"))
            rows.append(
                Figure(
                    f"wire time error, {rate} baud: median, 99th percentile",
                    f"{1e3 * robot[0]:+.2f} ms, {1e3 * robot[1]:.2f} ms",
                    f"bare pty that sleeps {1e3 * ideal:.1f} ms:"
                    f" {1e3 * bare[0]:+.2f} ms, {1e3 * bare[1]:.2f} ms",
                    f"{robot[1] / bare[1]:.2f}",
                )
            )
        return rows

    def _spread(self, name: str, rate: int) -> tuple[float, float]:
        errors = self._errors[name, rate]
        return median(errors), percentile([abs(error) for error in errors])


def _latencies(exchange: Exchange, count: int) -> list[float]:
    times = []
    clock = time.perf_counter
    for _ in range(count):
        start = clock()
        exchange(_REQUEST)
        times.append(clock() - start)
    return times


def _processor_time(pid: int) -> float:
    """Seconds that a process has had of the processor: its own and the system's for it."""
    fields = Path(f"/proc/{pid}/stat").read_text("utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def emulator(baud: str, *more: str) -> Iterator[tuple[str, int]]:
    """Start a robot's process; yield its terminal's path, and the process's number."""
    options = ("-m", "khepera_emulator.app.cli", "run", "--no-zenoh", "--arena", "open-box")
    with _process(*options, "--baud", baud, *more) as (announced, pid):
        yield announced.partition(" on ")[2].partition(",")[0], pid


def bare_pty(reply: str) -> AbstractContextManager[tuple[str, int]]:
    """Start a bare terminal's process; yield the same of it."""
    return _process(str(Path(__file__).with_name("bare_pty.py")), reply)


@contextmanager
def _process(*options: str) -> Iterator[tuple[str, int]]:
    """Start a Python process with a terminal; yield its first line, and its number."""
    process = subprocess.Popen([sys.executable, *options], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().rstrip("\n"), process.pid
    finally:
        process.terminate()
        process.communicate(timeout=30.0)
