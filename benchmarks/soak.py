"""`make soak`: long use of the serial line, and what is left of it; the table of docs/soak.md.

Everything that tests/test_soak.py and tests/test_line_machine.py do for a moment, for long. The
first thing that is not as it should be ends it with an error.
"""

import os
import platform
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count
from typing import Any

from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis.stateful import run_state_machine_as_test
from line_machine import LineMachine
from page import DOCS, report
from rich.console import Console
from soaking import PORTS, Use, kill_clients, never_read, reopen, robot_at, take_fuzz

_STEPS = 100_000
_STEPS_A_RUN = 50
_EXAMPLES = 250
_FUZZED = 10_000_000
_REOPENINGS = 1000
_KILLED = 100
_UNREAD = 200_000
_LEAK = 8192
"""Kilobytes that memory may grow by after the first tenth."""

_HEAD = ("port", "what", "memory before, after", "open files before, after", "took")


def main() -> None:
    """Do it all and print the table; `--write` puts it into docs/soak.md, too."""
    console = Console()
    rows: list[tuple[str, ...]] = []
    for row in _all():
        console.print(" | ".join(row))
        rows.append(row)
    machine = (
        f"One run; {os.cpu_count()} {platform.machine()} cores, load average"
        f" {os.getloadavg()[2]:.1f}, CPython {platform.python_version()}."
    )
    report("soak", _HEAD, rows, (DOCS / "soak.md", "table"), machine)


def _all() -> Iterator[tuple[str, ...]]:
    for kind in PORTS:
        with robot_at(kind) as place:
            began = time.monotonic()
            fuzzed = take_fuzz(place, _FUZZED)
            what = (
                f"{_FUZZED:,} fuzzed bytes; the next good request answered in"
                f" {1e3 * fuzzed.answer:.1f} ms"
            )
            yield _row(kind, what, fuzzed.before, fuzzed.after, began)
            began = time.monotonic()
            before = reopen(place, _REOPENINGS)
            yield _row(kind, f"{_REOPENINGS:,} reopenings", before, place.use(), began)
            if kind == "khepera":
                continue  # its robot goes with the port
            use: dict[str, Callable[[Any], None]] = {
                f"{_KILLED} killed clients": partial(kill_clients, number=_KILLED),
                f"a client that asks {_UNREAD:,} times and never reads": partial(
                    never_read, requests=_UNREAD
                ),
            }
            for name, befall in use.items():
                before, began = place.use(), time.monotonic()
                befall(place)
                yield _row(kind, name, before, place.use(), began)
    yield _machine_steps()


def _machine_steps() -> tuple[str, ...]:
    began = time.monotonic()
    limits = settings(
        max_examples=_EXAMPLES,
        stateful_step_count=_STEPS_A_RUN,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    # Hypothesis remembers all that it has drawn until it is done
    for batch in count():
        run_state_machine_as_test(seed(batch)(LineMachine), settings=limits)
        if LineMachine.steps >= _STEPS:
            break
    what = f"{LineMachine.steps:,} steps in any order, every request answered, no error"
    return "khepera", what, "", "", _minutes(began)


def _row(kind: str, what: str, before: Use, after: Use, began: float) -> tuple[str, ...]:
    if after.kilobytes > before.kilobytes + _LEAK or after.files > before.files + 1:
        raise AssertionError(f"{kind}: {what}: not flat: {before}, then {after}")
    return (
        kind,
        what,
        f"{before.kilobytes / 1024:.1f} MB, {after.kilobytes / 1024:.1f} MB",
        f"{before.files}, {after.files}",
        _minutes(began),
    )


def _minutes(began: float) -> str:
    minutes, seconds = divmod(round(time.monotonic() - began), 60)
    return f"{minutes} min {seconds} s"


if __name__ == "__main__":
    main()
