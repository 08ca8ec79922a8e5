"""The wire log of a robot as text, for the report of a test that has failed."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Final

from khepera_emulator.line.wire_log import Entry

_MOST: Final = 200
"""Lines of a report: the last ones, near to what went wrong."""


def report(entries: Iterable[Entry]) -> str:
    """Return entries of a wire log, a line each; of a long log the last ones."""
    lines = [str(entry) for entry in whole_replies(entries)]
    left_out = len(lines) - _MOST
    if left_out > 0:
        lines = [f"({left_out:,} lines before)", *lines[-_MOST:]]
    return "\n".join(lines)


def whole_replies(entries: Iterable[Entry]) -> Iterator[Entry]:
    """Join the pieces of a reply, which come as they were handed over, up to its line end."""
    begun: Entry | None = None
    for entry in entries:
        if begun and entry.what == "reply":
            entry = replace(entry, data=begun.data + entry.data)
        elif begun:
            yield begun
        begun = entry if entry.what == "reply" and not entry.data.endswith(b"\n") else None
        if not begun:
            yield entry
    if begun:
        yield begun
