"""Events beside the line: camera, emulator, router, clock."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

from fault_lines import end_of
from fault_trainings import kept_through, lost_in_training
from rig import Rig
from router import Router


class Event(NamedTuple):
    """Something that is done to a running robot, and undone."""

    name: str
    act: Callable[[Rig], None]
    undo: Callable[[Rig], None] = lambda _: None
    trouble: str = ""
    """Signals to the controller's process instead."""
    instead: str = ""
    """Text where there is no clock to measure a stop with."""


def event_row(bench: Rig, trained: Path, event: Event) -> tuple[str, ...]:
    """Stood within, driving again within, decisions and transitions lost, what became of it."""
    if event.trouble:
        return _troubled_row(bench, trained, event)
    bench.make_ready()
    controller = bench.controller(trained, speed=2, planner="circle")
    controller.wait_for_steps(1)
    bench.wait_until_moving()
    stood = _befall(bench, event)
    begin = time.monotonic()
    bench.wait_until_moving()
    again = time.monotonic() - begin
    controller.wait_for_steps(1)
    lost, ending = end_of(controller)
    bench.make_ready()
    learned = kept_through(bench, lambda: _befall(bench, event))
    return stood, f"{again:.1f} s", lost, learned, ending


def _befall(bench: Rig, event: Event) -> str:
    event.act(bench)
    stood = event.instead or f"{bench.time_to_stand():.2f} s"
    event.undo(bench)
    return stood


def _troubled_row(bench: Rig, trained: Path, event: Event) -> tuple[str, ...]:
    bench.make_ready()
    controller = bench.controller(trained, planner="circle", trouble=event.trouble)
    controller.wait_for(lambda lines: "jump" in lines)
    controller.wait_for_steps(3)
    lost, ending = end_of(controller)
    port = "khepera://open-box?seed=1"
    learned = lost_in_training(bench.folder / "trouble.npz", port, trouble=event.trouble)
    return "does not notice", "at once", lost, learned, ending


def _camera(mode: str) -> Event:
    def act(bench: Rig) -> None:
        _relay(bench).mode = mode

    def undo(bench: Rig) -> None:
        _relay(bench).mode = "pass"

    return Event(f"camera {_NAMES.get(mode, mode)}", act, undo)


_NAMES: Final = {"small": "of another size", "garbage": "sends garbage"}


def _relay(bench: Rig) -> Any:
    assert bench.relay is not None
    return bench.relay


def _freeze(bench: Rig) -> None:
    pid = bench.emulator.process.pid
    os.kill(pid, signal.SIGSTOP)
    time.sleep(2.0)
    os.kill(pid, signal.SIGCONT)


def _nothing(_: Rig) -> None:
    pass


EVENTS: Final = (
    *map(_camera, ("lost", "frozen", "late", "dark", "small", "garbage")),
    Event(
        "emulator killed and restarted",
        lambda bench: bench.restart_emulator(),
        instead="the emulator was gone",
    ),
    Event("emulator stopped for 2 s (SIGSTOP)", _freeze, instead="its clock stood still"),
    Event("wall clock jumps by an hour", _nothing, trouble="clock jump"),
)


def _router(bench: Rig) -> Router:
    assert bench.router is not None
    return bench.router


ROUTED: Final = Event(
    "router killed and restarted",
    lambda bench: _router(bench).kill(),
    lambda bench: _router(bench).start(),
)
