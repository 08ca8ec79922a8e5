"""A Khepera's line as others hear it: lines of text both ways."""

from collections import deque
from collections.abc import Iterator
from typing import Final

from khepera_protocol.serial.commands import COMMANDS
from khepera_protocol.serial.errors import ReplyError, RequestError
from khepera_protocol.serial.messages import (
    BANNER,
    COMMAND_NOT_FOUND,
    Reply,
    Request,
    parse_reply,
    parse_request,
)
from khepera_protocol.serial.units import battery_volts
from khepera_protocol.text import printable
from khepera_protocol.zenoh.payloads import WireEntry

from macor_hil.hardware.robots.form import NOTHING, REPLY, REQUEST, Passed, Reading

_DRIVES: Final = frozenset("CDP")
"""Letters of requests that turn the wheels."""

_ASKS: Final = frozenset("BEHIKNOR")
"""Letters of requests that only ask."""

_RECOUNTS: Final = "G"
"""Letter of the request that sets the position counters."""

_LAMPS: Final = "lateral", "frontal"
_TOGGLE: Final = 2

_WAITING: Final = 16
"""Requests that wait for their replies at most."""

_LONGEST: Final = 200
"""Characters of a line; the rest of a longer one is left out."""


class KheperaListener:
    """Reads a Khepera's line; see `form.Listener`.

    Args:
        dialect: a Khepera has one way of speaking.
    """

    def __init__(self, dialect: str = "") -> None:
        del dialect
        self._halves = {REQUEST: b"", REPLY: b""}
        self._waiting: deque[bytes] = deque(maxlen=_WAITING)
        self._lamps: list[bool | None] = [None, None]

    def take(self, entry: WireEntry) -> Iterator[Passed]:
        """Yield the lines that an entry ends; what it begins waits for the next one."""
        if entry.what not in self._halves:
            yield Passed(entry.what, printable(entry.text), entry.time)
            return
        hear = self._request if entry.what == REQUEST else self._reply
        data = self._halves[entry.what] + entry.text.encode("latin-1", "replace")
        *lines, rest = data.replace(b"\r", b"\n").split(b"\n")
        self._halves[entry.what] = rest[:_LONGEST]
        for line in lines:
            if line:
                yield hear(line, entry.time)

    def lose(self) -> None:
        """Forget halves and open requests."""
        self._waiting.clear()
        self._halves = dict.fromkeys(self._halves, b"")

    def _request(self, line: bytes, time: float) -> Passed:
        self._waiting.append(line)
        letter = line[:1].decode("latin-1")
        drives = letter in _DRIVES and line[1:2] == b","
        return Passed(
            REQUEST,
            printable(line, _LONGEST),
            time,
            asks=letter in _ASKS,
            drives=drives,
            reading=Reading(recounted=letter == _RECOUNTS),
        )

    def _reply(self, line: bytes, time: float) -> Passed:
        asked = next((each for each in self._waiting if _answers(line, each)), None)
        text = printable(line, _LONGEST)
        started = Reading(recounted=line.startswith(BANNER))
        if asked is None:
            return Passed(REPLY, text, time, reading=started)
        while self._waiting.popleft() is not asked:
            pass  # those before it got no answer
        answered = printable(asked, _LONGEST)
        told = started if started.recounted else self._read(asked, line)
        return Passed(REPLY, text, time, answers=answered, reading=told)

    def _read(self, asked: bytes, line: bytes) -> Reading:
        try:
            request = parse_request(asked)
            if not isinstance(request, Request):
                return NOTHING
            reply = parse_reply(request, line)
        except (RequestError, ReplyError):
            return NOTHING
        return self._told(request, reply)

    def _told(self, request: Request, reply: Reply) -> Reading:
        match request.letter:
            case "N":
                return Reading(proximity=reply.values)
            case "O":
                return Reading(ambient=reply.values)
            case "H":
                return Reading(counters=reply.values)
            case "E":
                return Reading(speed=reply.values)
            case "D":
                return Reading(wanted=request.arguments)
            case "I" if request.arguments == (0,):
                return Reading(battery=battery_volts(reply.values[0]))
            case "L":
                lamp, action = request.arguments
                return Reading(lamps=self._switched(lamp, action))
        return NOTHING

    def _switched(self, lamp: int, action: int) -> tuple[tuple[str, bool], ...]:
        """Return a lamp's new state; nobody knows it after a toggle of an unknown one."""
        lit: bool | None = bool(action)
        if action == _TOGGLE:
            before = self._lamps[lamp]
            lit = None if before is None else not before
        self._lamps[lamp] = lit
        return () if lit is None else ((_LAMPS[lamp], lit),)


def _answers(reply: bytes, request: bytes) -> bool:
    """Return whether a line may be the answer to a request."""
    refused = reply.startswith((b"z,", COMMAND_NOT_FOUND.encode()))
    letter = request[:1]
    if letter.decode("latin-1") not in COMMANDS:
        return True  # a tool, or garbage: anything may be said
    return refused or (reply[:1] == letter.lower() and reply[1:2] in (b",", b""))
