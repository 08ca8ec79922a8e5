"""Drives by hand, and runs that a dashboard steers, for `make stop-times`: how each is ended."""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from drives import MACOR_HIL, SLOW, WAYS_OUT, Cable, Drive
from emulator_process import PATIENCE
from hand_drives import HeldJoystick, driven_by_ros, teleop
from rig import Rig
from websockets.sync.client import connect

from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.wishes.stop_key import ask_to_stop

Cause = Callable[[Rig, Path, np.random.Generator], None]
Way = Callable[[Drive], None]

TELEOP: Final = "teleop"
ROS: Final = "ros2 --drive"
STEERED: Final = "dashboard --allow-control"

_ROUND: Final = (0.13, 2.6)
"""m/s and rad/s: a circle of 5 cm radius, the outer wheel as fast as it may be."""


def causes(wait: Callable[[Rig, np.random.Generator], None]) -> Iterator[tuple[str, str, Cause]]:
    """Yield every program that somebody drives or steers by, and every way to end that.

    Args:
        wait: returns at a random moment of a drive.
    """
    keys = {f"the key {name}": _key(key) for name, key in (("space", b" "), ("x", b"x"))}
    for way, end in {**WAYS_OUT, **keys}.items():
        yield TELEOP, way, _by_keys(wait, end)
    yield TELEOP, "stop request", _by_keys(wait, None)
    for way, end in WAYS_OUT.items():
        yield ROS, way, _by_ros(wait, end)
    yield ROS, "no twist follows", _let_go(wait)
    yield ROS, "a controller comes", _joined(wait)
    for wish in ("pause", "stop"):
        yield STEERED, wish, _steered(wait, wish)


def unseen(
    wait: Callable[[Rig, np.random.Generator], None], ways: dict[str, Way]
) -> Iterator[tuple[str, str, Cause]]:
    """Yield the same programs, ended by what they do not see: `ways`, and a pulled cable."""
    for way, end in ways.items():
        yield TELEOP, way, _by_keys(wait, end)
    yield TELEOP, "a pulled cable", _by_keys(wait, None, cable=True)
    for way, end in ways.items():
        yield ROS, way, _by_ros(wait, end)
    yield ROS, "a pulled cable", _by_ros(wait, None, cable=True)


def _key(key: bytes) -> Way:
    return lambda drive: drive.answer(key)


def _by_keys(
    wait: Callable[[Rig, np.random.Generator], None], end: Way | None, *, cable: bool = False
) -> Cause:
    """Return a cause that ends a slow command; without a way: the stop key, or a pulled cable."""

    def cause(bench: Rig, _: Path, rng: np.random.Generator) -> None:
        line = Cable(bench) if cable else None
        drive = teleop(bench, "--speed", str(SLOW), "--stop-key", port=line.port if line else None)
        drive.answer(b"w")
        with open_session([], [bench.controller_endpoint]) as session:
            wait(bench, rng)
            if line:
                line.pull()
            elif end:
                end(drive)
            else:
                ask_to_stop(session, "khepera")

    return cause


def _by_ros(
    wait: Callable[[Rig, np.random.Generator], None], end: Way | None, *, cable: bool = False
) -> Cause:
    """Return a cause that ends the program while the joystick is held; or pulls its cable."""

    def cause(bench: Rig, _: Path, rng: np.random.Generator) -> None:
        line = Cable(bench) if cable else None
        drive = driven_by_ros(bench, port=line.port if line else None)
        HeldJoystick(bench, _ROUND)
        wait(bench, rng)
        if line:
            line.pull()
        elif end:
            end(drive)

    return cause


def _let_go(wait: Callable[[Rig, np.random.Generator], None]) -> Cause:
    def cause(bench: Rig, _: Path, rng: np.random.Generator) -> None:
        driven_by_ros(bench)
        joystick = HeldJoystick(bench, _ROUND)
        wait(bench, rng)
        joystick.let_go()

    return cause


def _joined(wait: Callable[[Rig, np.random.Generator], None]) -> Cause:
    """Return a cause: a controller of that robot appears while the joystick is held."""

    def cause(bench: Rig, _: Path, rng: np.random.Generator) -> None:
        driven_by_ros(bench)
        joystick = HeldJoystick(bench, _ROUND)
        wait(bench, rng)
        joystick.join_a_controller()

    return cause


def _steered(wait: Callable[[Rig, np.random.Generator], None], wish: str) -> Cause:
    """Return a cause: a browser's wish, through the dashboard."""

    def cause(bench: Rig, trained: Path, rng: np.random.Generator) -> None:
        where = ["--port", "0", "--allow-control", "--connect", bench.controller_endpoint]
        shown = bench.start([*MACOR_HIL, "dashboard", *where])
        shown.wait_for(lambda lines: bool(lines))
        address = str(shown.lines[0]).replace("http", "ws", 1).rstrip("/")
        allowed: dict[str, Any] = {"stop_key": True, "steer_key": True}
        driver = bench.controller(trained, speed=SLOW, planner="circle", **allowed)
        driver.wait_for_steps(1)
        with connect(f"{address}/live") as page:
            page.send("{}")
            end = time.monotonic() + PATIENCE
            while "driving" not in str(page.recv(PATIENCE)):
                assert time.monotonic() < end, "the dashboard does not see the run"
            wait(bench, rng)
            page.send(json.dumps({"do": wish}))

    return cause
