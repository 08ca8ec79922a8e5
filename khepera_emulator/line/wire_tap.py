"""A tap on a serial line: its latest entries, kept in memory for those who watch it."""

from collections import deque
from itertools import accumulate, islice, takewhile

from khepera_protocol.zenoh.payload_model import MOST_TEXT
from khepera_protocol.zenoh.payloads import Wire, WireEntry

from khepera_emulator.line.coding import LineFormat
from khepera_emulator.line.fault import Happening

MOST_ENTRIES = 1024
"""Entries kept: a second's worth of a line in heavy use."""

MOST_TOLD = 100_000
"""Characters told at once, the latest ones: no watcher needs more, and a message has an end."""

_CUT = "…"


class WireTap:
    """Keeper of the latest entries of a line.

    Attributes:
        count: entries so far.
    """

    def __init__(self) -> None:
        self.count = 0
        # kept as they come, and made readable only for those who ask
        self._entries: deque[tuple[float, str, bytes | str]] = deque(maxlen=MOST_ENTRIES)
        self._settings: LineFormat | None = None

    def request(self, time: float, data: bytes) -> None:
        """Keep what a client has written."""
        self._add(time, "request", data)

    def reply(self, time: float, data: bytes) -> None:
        """Keep bytes that have reached the client."""
        self._add(time, "reply", data)

    def close(self, time: float) -> None:
        """Keep that the client has left."""
        self._add(time, "close", "")

    def line(self, time: float, line: LineFormat | None) -> None:
        """Keep the client's settings when they are new."""
        if line is not None and line != self._settings:
            self._settings = line
            self._add(time, "line", str(line))

    def fault(self, happening: Happening) -> None:
        """Keep a fault that has happened."""
        text = f"{happening.direction} {happening.kind}: {happening.what}"
        self._add(happening.time, "fault", text)

    def since(self, number: int) -> Wire:
        """Return entries from a number on, as far as they are still there."""
        lost = self.count - len(self._entries)
        sizes = accumulate(len(text) for _, _, text in reversed(self._entries))
        told = sum(1 for _ in takewhile(lambda size: size <= MOST_TOLD, sizes))
        first = max(number, self.count - told)
        return Wire(
            first=first,
            entries=[
                WireEntry(
                    time=time,
                    what=what,
                    text=text.decode("latin-1") if isinstance(text, bytes) else text,
                )
                for time, what, text in islice(self._entries, first - lost, None)
            ],
        )

    def _add(self, time: float, what: str, text: bytes | str) -> None:
        if len(text) > MOST_TEXT:
            whole = text.decode("latin-1") if isinstance(text, bytes) else text
            text = whole[: MOST_TEXT - 1] + _CUT
        self._entries.append((time, what, text))
        self.count += 1
