"""Much use of a running emulator: garbage, reopenings, killed clients, none that reads.

Each function does one of these to the robot at a place, and checks that the next good request is
answered at once, by its own reply. Short forms are tests; `make soak` does the long ones.
"""

import gc
import os
import random
import re
import select
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple, Self

import pytest
import serial
import serial.rfc2217
import serial.urlhandler.protocol_socket
from emulator_process import PATIENCE, emulator

import khepera_emulator  # noqa: F401 - registers khepera://

PORTS = ("pty", "socket", "rfc2217", "khepera")
PAGE = os.sysconf("SC_PAGE_SIZE")
TELNET_COMMAND = b"\xff"
_APART = 1000
_marks = count(_APART, _APART)

_WORDS = (
    b"A,3000,700,90 B C,100,-100 D,3,-3 E F,3000,20,4000 G,1,2 H I,0 J,10,32,10,32 K L,0,2 N O"
    b" P,5,5 R,3 T,1,B W,1,3 restart help net memory serial process var flash list ver"
).split()
"""Requests that fuzzed bytes are made from, beside plain chance."""

_TALKING = """
import os, sys
kind, url = sys.argv[1:]
if kind == "pty":
    line = os.open(url, os.O_RDWR | os.O_NOCTTY)
else:
    import socket
    host, _, port = url.rpartition("/")[2].rpartition(":")
    connection = socket.create_connection((host, int(port)))
    line = connection.fileno()
while True:
    os.write(line, b"N\\nH\\n")
    os.read(line, 20)
    print(flush=True)
"""

_STOP = b"\nD,0,0\nP,0,0\n"
_STOPPED = re.compile(rb"\nd\r\np\r\n\Z")
_VERSION = re.compile(rb"b,5\.01,5\.00\r\n\Z")
_MUCH = 1 << 14
_SILENCE = 0.2
"""Seconds without a byte after which all is said."""

_TAIL = 64
"""Bytes of what was said that are kept to see how it ends."""


class Use(NamedTuple):
    """The resources of a process."""

    kilobytes: int
    files: int


class Fuzzed(NamedTuple):
    """The effects of fuzzed bytes.

    Attributes:
        before: what was in use after a tenth of them.
        after: what was in use after all.
        answer: seconds that the next good request took.
    """

    before: Use
    after: Use
    answer: float


class Place(NamedTuple):
    """The place of a robot, and the process that it is in."""

    kind: str
    url: str
    pid: int

    def use(self) -> Use:
        """Memory and file descriptors of the robot's process; what is garbage does not count."""
        if self.pid == os.getpid():
            gc.collect()
        pages = int(Path(f"/proc/{self.pid}/statm").read_text().split()[1])
        return Use(pages * PAGE // 1024, len(list(Path(f"/proc/{self.pid}/fd").iterdir())))

    def open(self, **settings: Any) -> Any:
        """A pySerial port."""
        return serial.serial_for_url(self.url, timeout=PATIENCE, **settings)


@contextmanager
def robot_at(kind: str) -> Iterator[Place]:
    """An emulator in a process of its own, or, for `khepera`, a URL for one in this process."""
    if kind == "khepera":
        yield Place(kind, "khepera://corridor?baud=unpaced", os.getpid())
        return
    port = () if kind == "pty" else (f"--{kind.replace('socket', 'tcp')}", "127.0.0.1:0")
    with emulator("--no-zenoh", "--baud", "unpaced", *port) as running, impatience():
        yield Place(kind, running.path, running.process.pid)


@contextmanager
def impatience() -> Iterator[None]:
    """pySerial's network ports sleep a third of a second at every closing: a thousandth will do."""
    quick = SimpleNamespace(sleep=lambda seconds: time.sleep(min(seconds, 0.001)), time=time.time)
    with pytest.MonkeyPatch.context() as patch:
        for module in (serial.urlhandler.protocol_socket, serial.rfc2217):
            patch.setattr(module, "time", quick)
        yield


def fuzz(rng: random.Random, size: int) -> bytes:
    """Bytes by chance: plain ones, and requests with some of their bytes replaced."""
    pieces: list[bytes] = []
    length = 0
    while length < size:
        if rng.random() < 0.3:
            piece = rng.randbytes(rng.randrange(1, 64))
        else:
            line = bytearray(rng.choice(_WORDS) + rng.choice((b"\n", b"\r", b"\r\n")))
            for _ in range(rng.choice((0, 0, 1, 3))):
                line[rng.randrange(len(line))] = rng.randrange(256)
            piece = bytes(line)
        pieces.append(piece)
        length += len(piece)
    return b"".join(pieces)[:size]


class Line:
    """A program's end of the line without anything between: a terminal or a connection."""

    def __init__(self, place: Place) -> None:
        self._telnet = place.kind == "rfc2217"
        if place.kind == "pty":
            self.descriptor = os.open(place.url, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        else:
            with socket.create_connection(_address(place.url), PATIENCE) as connection:
                connection.setblocking(False)
                self.descriptor = connection.detach()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.descriptor)

    def write(self, data: bytes, *, escape: bool = True, listen: bool = True) -> bytes:
        """Send bytes, and read what is said meanwhile, of which the end is returned."""
        if self._telnet and escape:
            data = data.replace(TELNET_COMMAND, 2 * TELNET_COMMAND)
        left, said = memoryview(data), b""
        readers = [self.descriptor] if listen else []
        while left:
            readable, writable, _ = select.select(readers, [self.descriptor], [], PATIENCE)
            assert readable or writable, "the line is stuck"
            if readable:
                said = said[-_TAIL:] + os.read(self.descriptor, _MUCH)
            if writable:
                left = left[os.write(self.descriptor, left[:_MUCH]) :]
        return said

    def read(self, end: re.Pattern[bytes], said: bytes = b"") -> None:
        """Read on until what was said ends as expected."""
        while not end.search(said):
            if not select.select([self.descriptor], [], [], PATIENCE)[0]:
                raise AssertionError(f"the robot does not answer after {said!r}")
            said = said[-_TAIL:] + os.read(self.descriptor, _MUCH)

    def read_all(self) -> None:
        """Read on until nothing more is said."""
        while select.select([self.descriptor], [], [], _SILENCE)[0]:
            os.read(self.descriptor, _MUCH)


def answers(port: Any) -> float:
    """Ask good requests; returns the seconds until the first one's own reply was there."""
    mark = next(_marks)
    began = time.perf_counter()
    port.write(b"G,%d,7\n" % mark)
    said = port.read_until(b"\n")
    taken = time.perf_counter() - began
    assert said == b"g\r\n", said
    port.write(b"H\n")
    said = port.read_until(b"\n")
    # the wheels may turn a little yet
    assert said.startswith(b"h,"), said
    assert abs(int(said.split(b",")[1]) - mark) < _APART / 2, said
    return taken


def take_fuzz(place: Place, size: int, seed: int = 0) -> Fuzzed:
    """Send fuzzed bytes, read what is said, and ask something good."""
    rng = random.Random(seed)
    if place.kind == "khepera":
        return _take_fuzz_in_process(place, size, rng)
    with Line(place) as line:
        _send(line, rng, size // 10)
        before = place.use()
        _send(line, rng, size - size // 10)
        # what is not read in time is lost, as on a serial port: nothing may crowd out the reply
        line.read_all()
        line.read(_STOPPED, b"\n" + line.write(_STOP))
        after = place.use()
        began = time.perf_counter()
        line.write(b"B\n")
        line.read(_VERSION)
        taken = time.perf_counter() - began
    if place.kind == "rfc2217":
        with Line(place) as line:
            line.write(fuzz(rng, size // 10), escape=False)
    with place.open() as port:
        port.write(_STOP)
        port.read_until(b"p\r\n")
        return Fuzzed(before, after, max(taken, answers(port)))


def _send(line: Line, rng: random.Random, size: int) -> None:
    while size > 0:
        piece = fuzz(rng, min(_MUCH, size))
        line.write(piece)
        size -= len(piece)


def _take_fuzz_in_process(place: Place, size: int, rng: random.Random) -> Fuzzed:
    with place.open() as port:
        before = place.use()
        sent = 0
        while sent < size:
            sent += port.write(fuzz(rng, min(_MUCH, size - sent)))
            port.flush()
            port.reset_input_buffer()
            if sent < size // 10:
                before = place.use()
        port.write(_STOP)
        port.flush()
        port.reset_input_buffer()
        return Fuzzed(before, place.use(), answers(port))


def reopen(place: Place, times: int) -> Use:
    """Open and ask, and leave with replies under way: each program gets its own alone.

    Returns:
        What was in use after a tenth.
    """
    before = place.use()
    for number in range(times):
        with place.open() as port:
            answers(port)
            port.write(b"B\nN\nB\n")
            if number % 2:
                port.read(3)
        if number % 20 == 0:  # so often that garbage does not pile up
            used = place.use()
            before = used if number <= times // 10 else before
    return before


def kill_clients(place: Place, number: int) -> None:
    """Programs that are killed while they talk; the next one gets its own replies."""
    for _ in range(number):
        command = [sys.executable, "-S", "-c", _TALKING, place.kind, place.url]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            process.stdout.readline()
            process.kill()
        with place.open() as port:
            answers(port)


def never_read(place: Place, requests: int) -> None:
    """A program that asks and asks, and reads nothing; the next one gets its own replies."""
    with Line(place) as line:
        for _ in range(requests // 1000):
            line.write(b"B\n" * 1000, listen=False)
    with place.open() as port:
        answers(port)


def _address(url: str) -> tuple[str, int]:
    host, _, port = url.rpartition("/")[2].rpartition(":")
    return host, int(port)
