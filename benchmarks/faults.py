"""`make faults`: what befalls a robot, and what becomes of it; the table of docs/safety.md.

Everything is a process: emulator on a terminal, camera relay, router, controller. Times are on
the emulator's own clock. The machine's other programs show in them.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fault_events import EVENTS, ROUTED, event_row
from fault_lines import LINES, line_row
from fault_trainings import ended_row, full_disk_row
from page import DOCS, report
from rich.console import Console
from rig import rig
from short_training import train_shortly

from macor_hil.errors import BenchError

_HEAD = (
    "fault",
    "robot stood within",
    "driving again within",
    "decisions lost",
    "learned transitions lost",
    "the run",
)


def main() -> None:
    """Run all faults and print the table; `--write` puts it into docs/safety.md, too."""
    console = Console()
    found: list[tuple[str, ...]] = []
    with TemporaryDirectory() as folder:
        for row in rows(Path(folder)):
            console.print(" | ".join(row))
            found.append(row)
    report("faults", _HEAD, found, (DOCS / "safety.md", "faults"))


def rows(folder: Path) -> Iterator[tuple[str, ...]]:
    """One after the other, as they come."""
    trained = train_shortly(folder / "map.npz")
    for fault in LINES:
        yield fault.name, *_tried(line_row, folder, trained, fault)
    with rig(folder) as bench:
        for event in EVENTS:
            yield event.name, *_tried(event_row, bench, trained, event)
    with rig(folder, routed=True) as bench:
        yield ROUTED.name, *_tried(event_row, bench, trained, ROUTED)
    with rig(folder) as bench:
        for name in ("SIGINT", "SIGTERM", "SIGKILL"):
            row = _tried(ended_row, bench, trained, name)
            yield f"controller ended by {name}, started again", *row
    yield "full disk", *full_disk_row(folder)


def _tried(measure: Callable[..., tuple[str, ...]], *arguments: Any) -> tuple[str, ...]:
    """Return a row; try once more where a busy machine was too slow for the bench itself."""
    try:
        return measure(*arguments)
    except (AssertionError, BenchError):
        return measure(*arguments)


if __name__ == "__main__":
    main()
