"""Play the requests of a wire log to a robot, and compare what it says with the log.

The robot may be any pySerial port: an emulator in-process (its virtual time is kept exactly), one
on a terminal or on TCP, or a physical Khepera. A request is written at its time in the log.
"""

import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any, Final, Protocol

from serial import SerialBase

from khepera_emulator.line.clock import Clock
from khepera_emulator.line.wire_log import Entry, Recording

PATIENCE: Final = 2.0
"""Seconds that a reply may come later than in the log."""

_POLL: Final = 0.005
"""Seconds between two looks at a port in real time."""

_ALL: Final = 1 << 16
_ON_TIME: Final = ("request", "reply", "line", "close")
"""Entries whose times never fall: those of faults may lie ahead."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A difference between the log and a robot's replies.

    Attributes:
        time: seconds in the log.
        request: what was written last before it.
        logged: the line in the log.
        said: the robot's; empty if it said nothing.
    """

    time: float
    request: bytes
    logged: bytes
    said: bytes

    def __str__(self) -> str:
        return (
            f"difference at {self.time:.3f} s, after the request {self.request!r}\n"
            f"  log:   {self.logged!r}\n"
            f"  robot: {self.said!r}" + ("" if self.said else " (nothing came)")
        )


@dataclass(frozen=True, slots=True)
class _Line:
    """A line of the log's replies, and what led to it."""

    time: float
    request: bytes
    data: bytes


class _Player(Protocol):
    """A robot's end of the line, and its time."""

    def write(self, data: bytes) -> None:
        """Put bytes on the line, now."""

    def wait(self, moment: float) -> bytes:
        """Let time pass to a moment; return what comes meanwhile."""

    def more(self) -> bytes:
        """Wait a little longer and return what comes; empty when patience is at its end."""

    def leave(self) -> None:
        """Close the line and open it again."""


def replay(
    recording: Recording, port: SerialBase, ignore: Collection[str] = ()
) -> Difference | int:
    """Play a log to a robot.

    Args:
        recording: the log.
        port: the robot, as after power-on.
        ignore: letters of requests whose replies may have other values, though as many.

    Returns:
        The first difference, or how many lines were equal.
    """
    player: _Player = _Virtual(port) if hasattr(port, "emulator") else _Real(port)
    letters = {letter.lower() for letter in ignore}
    equal = 0
    for entries in _visits(recording.entries):
        lines = list(_lines(entries))
        result = _play(player, port, entries, lines, letters)
        if isinstance(result, Difference):
            return result
        equal += result
    return equal


def _play(
    player: _Player,
    port: SerialBase,
    entries: list[Entry],
    lines: list[_Line],
    letters: Collection[str],
) -> Difference | int:
    """Play one client's visit; the log may end in the middle of a line."""
    comparison = _Comparison(lines, letters)
    for entry in entries:
        if entry.what not in _ON_TIME:
            continue
        difference = comparison.take(player.wait(entry.time))
        if difference:
            return difference
        if entry.what == "request":
            player.write(entry.data)
        elif entry.what == "line" and entry.line:
            port.baudrate = entry.line.baud
            port.bytesize, port.parity = entry.line.bits, entry.line.parity
    left = entries[-1].what == "close"
    # in virtual time a reply is where it was, or it is not there at all
    while not comparison.complete and not (left and isinstance(player, _Virtual)):
        data = player.more()
        if not data:
            break
        difference = comparison.take(data)
        if difference:
            return difference
    if left:
        player.leave()
    return comparison.end()


class _Comparison:
    """Lines of a robot against those of the log."""

    def __init__(self, lines: list[_Line], letters: Collection[str]) -> None:
        self._lines = lines
        self._letters = letters
        self._place = 0
        self._rest = b""

    @property
    def complete(self) -> bool:
        """True once all lines of the log have come."""
        if self._place >= len(self._lines):
            return True
        last = self._lines[self._place].data
        return not last.endswith(b"\n") and self._rest.startswith(last)

    def take(self, data: bytes) -> Difference | None:
        """Compare bytes of the robot; what follows the end of the log is not compared."""
        *whole, self._rest = (self._rest + data).split(b"\n")
        for each in whole:
            if self._place >= len(self._lines):
                return None
            line = self._lines[self._place]
            said = each + b"\n"
            cut = not line.data.endswith(b"\n")
            if not (said.startswith(line.data) if cut else self._agree(line.data, said)):
                return Difference(line.time, line.request, line.data, said)
            self._place += 1
        return None

    def end(self) -> Difference | int:
        """Return what is missing when all has come, or how many lines were equal."""
        if self.complete:
            return len(self._lines)
        line = self._lines[self._place]
        return Difference(line.time, line.request, line.data, self._rest)

    def _agree(self, logged: bytes, said: bytes) -> bool:
        if logged == said:
            return True
        letter = logged[:1].decode("latin-1")
        if letter not in self._letters or logged[:2] != said[:2]:
            return False
        return logged.count(b",") == said.count(b",")


class _Virtual:
    """An emulator in this process: its time passes when it is read."""

    def __init__(self, port: Any) -> None:
        self._port = port

    def write(self, data: bytes) -> None:
        # not by the port: there a write takes time on a line that takes none
        self._port.emulator.write(data)

    def wait(self, moment: float) -> bytes:
        # not by reading with a time-out: that has a least time
        emulator = self._port.emulator
        emulator.advance(moment)
        return bytes(emulator.read())

    def more(self) -> bytes:
        self._port.timeout = PATIENCE
        return bytes(self._port.read(_ALL))

    def leave(self) -> None:
        # the robot stays as it is
        self._port.emulator.hang_up()


class _Real:
    """Any other port: its time is ours, from the first entry on."""

    def __init__(self, port: Any) -> None:
        self._port = port
        self._clock: Clock | None = None
        self._origin = 0.0
        port.timeout = _POLL

    def write(self, data: bytes) -> None:
        self._port.write(data)

    def wait(self, moment: float) -> bytes:
        if self._clock is None:
            self._clock, self._origin = Clock(), moment
        data = b""
        while (left := self._clock.delay(moment - self._origin)) > _POLL:
            data += bytes(self._port.read(_ALL))
        time.sleep(left)
        return data

    def more(self) -> bytes:
        clock = Clock()
        while clock.now < PATIENCE:
            if data := self._port.read(_ALL):
                return bytes(data)
        return b""

    def leave(self) -> None:
        self._port.close()
        self._port.open()


def _visits(entries: Collection[Entry]) -> Iterator[list[Entry]]:
    """Yield the entries of one client after the other."""
    visit: list[Entry] = []
    for entry in entries:
        visit.append(entry)
        if entry.what == "close":
            yield visit
            visit = []
    if visit:
        yield visit


def _lines(entries: list[Entry]) -> Iterator[_Line]:
    """Yield the lines of a visit's replies; the last one may lack its end."""
    rest, request = b"", b""
    when = 0.0
    for entry in entries:
        if entry.what == "request":
            request = entry.data
        elif entry.what == "reply":
            when = entry.time
            *whole, rest = (rest + entry.data).split(b"\n")
            for each in whole:
                yield _Line(when, request, each + b"\n")
    if rest:
        yield _Line(when, request, rest)
