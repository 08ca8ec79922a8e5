"""State of a robot's serial line, whoever drives: exchanges, readings, speeds and lamps."""

from collections import deque
from dataclasses import dataclass
from math import inf
from typing import Final, NamedTuple

from khepera_protocol.serial.commands import COMMANDS
from khepera_protocol.serial.errors import ReplyError, RequestError
from khepera_protocol.serial.messages import (
    COMMAND_NOT_FOUND,
    Reply,
    Request,
    parse_reply,
    parse_request,
)
from khepera_protocol.text import printable
from khepera_protocol.zenoh.payloads import Wire, WireEntry

DRIVES: Final = frozenset("CDP")
"""Letters of requests that turn the wheels."""

_POLLS: Final = frozenset("BEHIKNOR")
"""Letters of requests that only ask: repeated ones are told once, with their number."""

_ROWS: Final = 60
_WAITING: Final = 16
"""Requests that wait for their replies at most."""

_LONGEST: Final = 200
"""Characters of a line; the rest of a longer one is left out."""


class Readings(NamedTuple):
    """Eight infrared readings, in the order of N's reply, and when they came (the watcher's clock).

    `when` is minus infinity where they were told of an earlier time.
    """

    values: tuple[int, ...]
    when: float


@dataclass(slots=True)
class Exchange:
    """A request and its reply; or, where `request` is empty, another event of the line.

    Attributes:
        request, reply: lines without their ends, fit for a terminal; a reply may be missing.
        time: when the request passed, seconds on the robot's clock.
        taken: seconds from request to reply; None while there is none.
        count: how many of the same request there were, this being the latest.
    """

    request: str
    reply: str
    time: float
    taken: float | None = None
    count: int = 1


class LineState:
    """The state of a robot's line, from the events that passed on it.

    Attributes:
        rows: the latest exchanges and events, oldest first; polls between two others are one row.
        version: another number whenever something has passed.
        proximity, ambient: the latest readings of N and O, or None.
        counters, speed: of both wheels, as H and E told them last; None: they did not.
        wanted: the speeds that D asked for last, in the units of D; None: none, or since another
            request that drives.
        leds: the lateral and the frontal lamp, as far as requests told; None: unknown.
        asked, driven: when a request came, and one that drives, on the watcher's clock; None:
            never.
    """

    def __init__(self) -> None:
        self.rows: deque[Exchange] = deque(maxlen=_ROWS)
        self.version = 0
        self.proximity: Readings | None = None
        self.ambient: Readings | None = None
        self.counters: tuple[int, ...] | None = None
        self.speed: tuple[int, ...] | None = None
        self.wanted: tuple[int, ...] | None = None
        self.leds: list[bool | None] = [None, None]
        self.asked: float | None = None
        self.driven: float | None = None
        self._next: int | None = None
        self._waiting: deque[tuple[bytes, float]] = deque(maxlen=_WAITING)
        self._halves = {"request": b"", "reply": b""}
        self._polled: dict[str, Exchange] = {}

    def take(self, wire: Wire, now: float | None) -> None:
        """Take in what has passed.

        Args:
            wire: it; what was told before is left out.
            now: the watcher's time; None: it passed some time ago.
        """
        if self._next is not None and wire.first > self._next:
            self._lose(wire.first - self._next)
        known = max(0, (self._next or 0) - wire.first)
        for entry in wire.entries[known:]:
            self._pass(entry, now)
        self._next = max(self._next or 0, wire.first + len(wire.entries))
        self.version += 1

    def _pass(self, entry: WireEntry, now: float | None) -> None:
        if entry.what in self._halves:
            for line in self._lines(entry):
                if entry.what == "request":
                    self._request(line, entry.time, now)
                else:
                    self._reply(line, entry.time, now)
        else:
            self._tell(Exchange("", printable(f"{entry.what} {entry.text}".strip()), entry.time))

    def _lines(self, entry: WireEntry) -> list[bytes]:
        """Return the lines that an entry ends; what it begins waits for the next one."""
        data = self._halves[entry.what] + entry.text.encode("latin-1", "replace")
        *lines, rest = data.replace(b"\r", b"\n").split(b"\n")
        self._halves[entry.what] = rest[:_LONGEST]
        return [line for line in lines if line]

    def _request(self, line: bytes, time: float, now: float | None) -> None:
        self._waiting.append((line, time))
        self.asked = now if now is not None else self.asked
        letter = line[:1].decode("latin-1")
        if letter in DRIVES and line[1:2] == b",":
            self.driven = now if now is not None else self.driven
            self.wanted = None
        row = Exchange(printable(line, _LONGEST), "", time)
        if letter in _POLLS:
            last = self._polled.get(row.request)
            if last is not None:
                last.count, last.time, last.taken = last.count + 1, time, None
                return
            self._polled[row.request] = row
            self.rows.append(row)
        else:
            self._tell(row)

    def _reply(self, line: bytes, time: float, now: float | None) -> None:
        asked = next((each for each in self._waiting if _answers(line, each[0])), None)
        text = printable(line, _LONGEST)
        if asked is None:
            self._tell(Exchange("", text, time))
            return
        while self._waiting.popleft() is not asked:
            pass  # those before it got no answer
        request = printable(asked[0], _LONGEST)
        row = next(
            (r for r in reversed(self.rows) if r.request == request and r.taken is None), None
        )
        if row is not None:
            row.reply, row.taken = text, time - row.time
        self._learn(asked[0], line, now)

    def _learn(self, asked: bytes, line: bytes, now: float | None) -> None:
        try:
            request = parse_request(asked)
            if not isinstance(request, Request):
                return
            reply = parse_reply(request, line)
        except (RequestError, ReplyError):
            return
        self._note(request, reply, -inf if now is None else now)

    def _note(self, request: Request, reply: Reply, when: float) -> None:
        match request.letter:
            case "N":
                self.proximity = Readings(reply.values, when)
            case "O":
                self.ambient = Readings(reply.values, when)
            case "H":
                self.counters = reply.values
            case "E":
                self.speed = reply.values
            case "D":
                self.wanted = request.arguments
            case "L":
                lamp, action = request.arguments
                before = self.leds[lamp]
                self.leds[lamp] = (before is False) if action == 2 else bool(action)

    def _tell(self, row: Exchange) -> None:
        self._polled.clear()
        self.rows.append(row)

    def _lose(self, count: int) -> None:
        """Forget halves of lines: what would have made them whole did not come."""
        self._waiting.clear()
        self._halves = dict.fromkeys(self._halves, b"")
        last = self.rows[-1].time if self.rows else 0.0
        self._tell(Exchange("", f"{count} events did not come here", last))


def _answers(reply: bytes, request: bytes) -> bool:
    """Return whether a line may be the answer to a request."""
    refused = reply.startswith((b"z,", COMMAND_NOT_FOUND.encode()))
    letter = request[:1]
    if letter.decode("latin-1") not in COMMANDS:
        return True  # a tool, or garbage: anything may be said
    return refused or (reply[:1] == letter.lower() and reply[1:2] in (b",", b""))
