"""`make stop-times`: how long the robot rolls on after all that must stop it; for docs/safety.md.

A stop watch on the emulator's own clock: from the moment before the cause to the wheels' last
turn. Every program that drives is ended in every way, as a process on a terminal of its own. It
drives slowly, 1.7 s a command and longer without commands, and the cause comes at a random moment,
so that a robot that only ends its command shows.

What no program can see (SIGKILL, SIGSTOP, a pulled cable) is measured with a robot that stops by
itself (`--dead-man`), and without.
"""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
import stops_by_hand
from drives import WAYS_OUT, Cable, Drive, programs
from figures import percentile
from page import DOCS, report, table_of
from rich.console import Console
from rich.progress import track
from rig import Rig, rig
from short_training import train_shortly

from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.wishes.stop_key import ask_to_stop

_TIMES: Final = 10
_FEW_TIMES: Final = 5
_LIMIT: Final = 0.5
_DEAD_MAN: Final = 0.3
_ATTEMPTS: Final = 3
_LAST_WORDS: Final = 300
_HEAD: Final = (
    *("program", "ended by", "stops", "median", "90th percentile", "longest"),
    f"within {_LIMIT} s",
)

Cause = Callable[[Rig, Path, np.random.Generator], None]
"""Makes a robot drive, and comes at a random moment."""


def main() -> None:
    """Measure and print; `--write` puts the rows into the tables of docs/safety.md, too.

    Further arguments choose programs by their names; rows of the others stay.
    """
    chosen = [word for word in sys.argv[1:] if not word.startswith("-")]
    load = "Two cores that other programs shared (load average {:.1f})."
    with TemporaryDirectory() as folder:
        trained = train_shortly(Path(folder) / "map.npz")
        with rig(folder) as bench:
            causes = (each for each in _causes() if not chosen or each[0] in chosen)
            rows = [*_rows(bench, trained, causes, _TIMES)]
        note = load.format(os.getloadavg()[1])
        _report("stops, on the emulator's clock", "stop times", rows, note)
        rows = [*_unseen(Path(folder), trained, chosen)]
        _report("ways out that no program sees", "unseen stops", rows)


def _report(title: str, part: str, rows: list[tuple[str, ...]], note: str = "") -> None:
    """Print rows; in the docs they take the place of earlier ones of the same programs."""
    page = DOCS / "safety.md"
    measured = {row[:2]: row for row in rows}
    earlier = {row[:2]: row for row in table_of(page, part)[1:]}
    report(title, _HEAD, [*(earlier | measured).values()], (page, part), note)


def _causes() -> Iterator[tuple[str, str, Cause]]:
    """Every program, and every way to end it."""
    yield from (("run", f"camera {mode}", _camera(mode)) for mode in _MODES)
    yield "run", "planner late", _trouble("slow planner", "slow", speed=2)
    # at full speed, which is what tells that process that the wheels turn
    yield "run", "exception", _trouble("exception", "broken")
    yield "run", "stop request", _stop_request
    yield "run", "output closed", _closed_output
    for program in ("run", "train", "trials", "calibrate", "Commands", "Wheels"):
        yield from ((program, way, _ended(program, way)) for way in WAYS_OUT)
    for program in ("Commands", "Wheels"):
        yield program, "exception", _ended(program, "exception")
    yield from stops_by_hand.causes(_wait_for_a_moment)


def _rows(
    bench: Rig, trained: Path, causes: Iterator[tuple[str, str, Cause]], times: int
) -> Iterator[tuple[str, ...]]:
    console, rng = Console(), np.random.default_rng(1)
    for program, name, cause in causes:
        rounds = track(range(times), f"{program}: {name}", console=console, transient=True)
        row = _row(program, name, [_stop(bench, trained, cause, rng) for _ in rounds])
        console.print(" | ".join(row))
        yield row


def _row(program: str, name: str, times: list[float]) -> tuple[str, ...]:
    shares = (percentile(times, share) for share in (50.0, 90.0, 100.0))
    within = sum(seconds <= _LIMIT for seconds in times)
    told = _TOLD.get(program, f"`{program}`")
    return (
        *(told, name, str(len(times))),
        *(f"{share:.2f} s" for share in shares),
        f"{within} of {len(times)}",
    )


_TOLD: Final[Mapping[str, str]] = {
    name: f"a learner in `khepera/{name}-v0`" for name in ("Commands", "Wheels")
}
"""Names of programs that are not a command."""


def _stop(bench: Rig, trained: Path, cause: Cause, rng: np.random.Generator) -> float:
    for attempt in range(_ATTEMPTS):
        bench.make_ready()
        try:
            cause(bench, trained, rng)
        except AssertionError:  # it did not get to drive: a machine busy with others
            if attempt == _ATTEMPTS - 1:
                raise
        else:
            break
    seconds: float = bench.time_to_stand()
    return seconds


def _ended(program: str, way: str) -> Cause:
    """Return a cause: a program on a terminal of its own, ended in mid-drive."""

    def end(bench: Rig, trained: Path, rng: np.random.Generator) -> None:
        drive = Drive(bench.controllers, programs(bench, trained)[program])
        try:
            _wait_for_a_moment(bench, rng)
        except AssertionError as error:
            raise AssertionError(f"{error}: {drive.said.decode()[-_LAST_WORDS:]}") from None
        _WAYS[way](drive)

    return end


_WAYS: Final[Mapping[str, Callable[[Drive], None]]] = {
    **WAYS_OUT,
    "exception": lambda drive: drive.signal(signal.SIGUSR1),  # for those that raise one then
    "SIGKILL": lambda drive: drive.signal(signal.SIGKILL),
    "SIGSTOP": lambda drive: drive.signal(signal.SIGSTOP),
}


def _wait_for_a_moment(bench: Rig, rng: np.random.Generator) -> None:
    """Wait for a random moment of a command."""
    bench.wait_until_moving()
    time.sleep(rng.uniform(0.0, 0.9))


def _drive(bench: Rig, trained: Path, rng: np.random.Generator, **fields: Any) -> Any:
    """Return a controller at a random moment of a command."""
    controller = bench.controller(trained, speed=2, planner="circle", **fields)
    controller.wait_for_steps(1)
    _wait_for_a_moment(bench, rng)
    return controller


_MODES: Final = ("lost", "frozen", "late", "dark")


def _camera(mode: str) -> Cause:
    def fail(bench: Rig, trained: Path, rng: np.random.Generator) -> None:
        _drive(bench, trained, rng)
        assert bench.relay is not None
        bench.relay.mode = mode

    return fail


def _stop_request(bench: Rig, trained: Path, rng: np.random.Generator) -> None:
    with open_session([], [bench.controller_endpoint]) as session:
        _drive(bench, trained, rng, stop_key=True)
        ask_to_stop(session, "khepera")


def _closed_output(bench: Rig, trained: Path, rng: np.random.Generator) -> None:
    drive = Drive(bench.controllers, programs(bench, trained)["run"], output=True)
    _wait_for_a_moment(bench, rng)
    drive.close_output()


def _trouble(trouble: str, word: str, **fields: Any) -> Cause:
    """Return a cause: trouble in the controller's process, which says a word as it begins."""

    def wait(bench: Rig, trained: Path, _: np.random.Generator) -> None:
        controller = bench.controller(trained, trouble=trouble, **fields)
        controller.wait_for(lambda lines: word in lines)

    return wait


def _unseen(folder: Path, trained: Path, chosen: list[str]) -> Iterator[tuple[str, ...]]:
    """SIGKILL, SIGSTOP and a pulled cable, of a real robot and of one that stops by itself."""
    for options in ((), ("--dead-man", str(_DEAD_MAN))):
        robot = f", `{' '.join(options)}`" if options else ""
        with rig(folder, *options) as bench:
            causes = (
                (program, f"{way}{robot}", cause)
                for program, way, cause in _unseen_causes()
                if not chosen or program in chosen
            )
            yield from _rows(bench, trained, causes, _FEW_TIMES)


def _unseen_causes() -> Iterator[tuple[str, str, Cause]]:
    for program in ("run", "calibrate", "Wheels"):
        yield program, "SIGKILL", _ended(program, "SIGKILL")
        yield program, "SIGSTOP", _ended(program, "SIGSTOP")
        yield program, "a pulled cable", _pulled(program)
    ways = {way: _WAYS[way] for way in ("SIGKILL", "SIGSTOP")}
    yield from stops_by_hand.unseen(_wait_for_a_moment, ways)


def _pulled(program: str) -> Cause:
    def pull(bench: Rig, trained: Path, rng: np.random.Generator) -> None:
        cable = Cable(bench)
        Drive(bench.controllers, programs(bench, trained, cable.port)[program])
        _wait_for_a_moment(bench, rng)
        cable.pull()

    return pull


if __name__ == "__main__":
    main()
