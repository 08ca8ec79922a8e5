"""State of a robot's serial line, whoever drives: exchanges, readings, speeds and lamps."""

from collections import deque
from dataclasses import dataclass
from math import inf
from typing import Final, NamedTuple

from khepera_protocol.text import printable
from khepera_protocol.zenoh.payloads import Wire

from macor_hil.hardware.robots.form import REPLY, REQUEST, Listener, Passed, Reading
from macor_hil.hardware.robots.forms import form_of

_ROWS: Final = 60
_MORE: Final = " / "
"""Between the lines of a reply."""

_LONGEST: Final = 1000
"""Characters of a reply of many lines that are kept."""


class Readings(NamedTuple):
    """Eight readings, and when they came (the watcher's clock).

    `when` is minus infinity where they were told of an earlier time.
    """

    values: tuple[int, ...]
    when: float


@dataclass(slots=True)
class Exchange:
    """A request and its reply; or, where `request` is empty, another event of the line.

    Attributes:
        request, reply: as they are shown, fit for a terminal; a reply may be missing.
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
        proximity: the latest infrared readings, in the driver's order and scale, or None.
        ambient: the latest readings of ambient light, as they were told, or None.
        counters, speed: of both wheels, as they were told last; None: they were not.
        wanted: the speeds that were asked for last, in the robot's units; None: none, or since
            another request that drives.
        lamps: those of which requests told whether they shine.
        battery: volts; None: nobody asked.
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
        self.lamps: dict[str, bool] = {}
        self.battery: float | None = None
        self.asked: float | None = None
        self.driven: float | None = None
        self._next: int | None = None
        self._listener: Listener | None = None
        self._spoken = ("", "")
        self._polled: dict[str, Exchange] = {}

    def take(self, wire: Wire, now: float | None) -> None:
        """Take in what has passed.

        Args:
            wire: it; what was told before is left out.
            now: the watcher's time; None: it passed some time ago.
        """
        spoken = wire.robot_kind, wire.dialect
        if self._listener is None or spoken != self._spoken:
            self._spoken = spoken
            self._listener = form_of(wire.robot_kind).listener(wire.dialect)
        if self._next is not None and wire.first > self._next:
            self._lose(wire.first - self._next)
        known = max(0, (self._next or 0) - wire.first)
        for entry in wire.entries[known:]:
            for passed in self._listener.take(entry):
                self._pass(passed, now)
        self._next = max(self._next or 0, wire.first + len(wire.entries))
        self.version += 1

    def _pass(self, passed: Passed, now: float | None) -> None:
        if passed.what == REQUEST:
            self._request(passed, now)
        elif passed.what == REPLY:
            self._reply(passed)
        else:
            text = f"{passed.what} {passed.text}".strip()
            self._tell(Exchange("", printable(text), passed.time))
        self._note(passed.reading, -inf if now is None else now)

    def _request(self, passed: Passed, now: float | None) -> None:
        self.asked = now if now is not None else self.asked
        if passed.drives:
            self.driven = now if now is not None else self.driven
            self.wanted = None
        row = Exchange(passed.text, "", passed.time)
        if not passed.asks:
            self._tell(row)
            return
        last = self._polled.get(passed.text)
        if last is not None:
            last.count, last.time, last.taken = last.count + 1, passed.time, None
            return
        self._polled[passed.text] = row
        self.rows.append(row)

    def _reply(self, passed: Passed) -> None:
        rows = (each for each in reversed(self.rows) if each.request)
        row = next(
            (
                each
                for each in rows
                if each.request == passed.answers and (each.taken is None) != passed.more
            ),
            None,
        )
        if row is None and not passed.answers:
            self._tell(Exchange("", passed.text, passed.time))
        elif row is not None and passed.more:
            row.reply = f"{row.reply}{_MORE}{passed.text}"[:_LONGEST]
        elif row is not None:
            row.reply, row.taken = passed.text, passed.time - row.time

    def _note(self, reading: Reading, when: float) -> None:
        """Take in what is told; what is not told stays as it was."""
        if reading.proximity is not None:
            self.proximity = Readings(reading.proximity, when)
        if reading.ambient is not None:
            self.ambient = Readings(reading.ambient, when)
        self.counters = reading.counters or self.counters
        self.speed = reading.speed or self.speed
        self.wanted = reading.wanted or self.wanted
        self.lamps.update(reading.lamps)
        self.battery = self.battery if reading.battery is None else reading.battery

    def _tell(self, row: Exchange) -> None:
        self._polled.clear()
        self.rows.append(row)

    def _lose(self, count: int) -> None:
        """Forget halves: what would have made them whole did not come."""
        if self._listener is not None:
            self._listener.lose()
        last = self.rows[-1].time if self.rows else 0.0
        self._tell(Exchange("", f"{count} events did not come here", last))
