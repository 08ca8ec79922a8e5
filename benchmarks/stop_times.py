"""`make stop-times`: how long the robot rolls on after all that must stop it; for docs/safety.md.

A stop watch on the emulator's own clock: from the moment before the cause to the wheels' last
turn. Commands are driven slowly, 1.7 s each, and the cause comes at a random moment of one, so that
a robot that only ends its command shows.
"""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from figures import percentile
from page import DOCS, report
from rich.console import Console
from rich.progress import track
from rig import Rig, rig
from short_training import train_shortly

from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.stop_key import ask_to_stop

_TIMES: Final = 12
_LIMIT: Final = 0.5
_HEAD: Final = ("cause", "stops", "median", "90th percentile", "longest", f"within {_LIMIT} s")

Cause = Callable[[Rig, Path, np.random.Generator], None]


def main() -> None:
    """Measure and print; `--write` puts the table into docs/safety.md, too."""
    console = Console()
    rng = np.random.default_rng(1)
    rows = []
    with TemporaryDirectory() as folder:
        trained = train_shortly(Path(folder) / "map.npz")
        with rig(folder) as bench:
            for name, cause in CAUSES.items():
                rounds = track(range(_TIMES), name, console=console, transient=True)
                rows.append(_row(name, [_stop(bench, trained, cause, rng) for _ in rounds]))
                console.print(" | ".join(rows[-1]))
    title = "from a cause to standstill, on the emulator's clock"
    load = f"Two cores, load average {os.getloadavg()[1]:.1f}."
    report(title, _HEAD, rows, (DOCS / "safety.md", "stop times"), load)


def _row(name: str, times: list[float]) -> tuple[str, ...]:
    shares = (percentile(times, share) for share in (50.0, 90.0, 100.0))
    within = sum(seconds <= _LIMIT for seconds in times)
    return (
        name,
        str(len(times)),
        *(f"{share:.2f} s" for share in shares),
        f"{within} of {len(times)}",
    )


def _stop(bench: Rig, trained: Path, cause: Cause, rng: np.random.Generator) -> float:
    bench.make_ready()
    cause(bench, trained, rng)
    seconds: float = bench.time_to_stand()
    return seconds


def _drive(bench: Rig, trained: Path, rng: np.random.Generator, **fields: Any) -> Any:
    """A controller at a random moment of a command."""
    controller = bench.controller(trained, speed=2, planner="circle", **fields)
    controller.wait_for_steps(1)
    bench.wait_until_moving()
    time.sleep(rng.uniform(0.0, 0.9))
    return controller


def _camera(mode: str) -> Cause:
    def fail(bench: Rig, trained: Path, rng: np.random.Generator) -> None:
        _drive(bench, trained, rng)
        assert bench.relay is not None
        bench.relay.mode = mode

    return fail


def _signal(number: signal.Signals) -> Cause:
    def send(bench: Rig, trained: Path, rng: np.random.Generator) -> None:
        os.kill(_drive(bench, trained, rng).process.pid, number)

    return send


def _stop_request(bench: Rig, trained: Path, rng: np.random.Generator) -> None:
    with open_session([], [bench.controller_endpoint]) as session:
        _drive(bench, trained, rng, stop_key=True)
        ask_to_stop(session, "khepera")


def _trouble(trouble: str, word: str, **fields: Any) -> Cause:
    """The controller's process says a word when its trouble begins."""

    def wait(bench: Rig, trained: Path, _: np.random.Generator) -> None:
        controller = bench.controller(trained, trouble=trouble, **fields)
        controller.wait_for(lambda lines: word in lines)

    return wait


CAUSES: Final[dict[str, Cause]] = {
    **{f"camera {mode}": _camera(mode) for mode in ("lost", "frozen", "late", "dark")},
    "planner late": _trouble("slow planner", "slow", speed=2),
    "stop request": _stop_request,
    "Ctrl-C": _signal(signal.SIGINT),
    "SIGTERM": _signal(signal.SIGTERM),
    # at full speed, which is what tells that process that the wheels turn
    "exception": _trouble("exception", "broken"),
}


if __name__ == "__main__":
    main()
