"""Simulated time over processor time of robots in an open box, in the caller's process.

Processor time, so that other programs on the machine do not count: what a core of its own gives.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from time import process_time
from typing import NamedTuple

import pybullet
from figures import Figure
from stopwatch import Part, Stopwatch

from khepera_emulator.arena import load_arena
from khepera_emulator.emulator import Emulator, Setup, make_fleet
from khepera_emulator.infrared import Infrared
from protocol.side_channel import Pose, Reset

_STEP = 0.020
"""Seconds of simulated time between two looks at the robot."""

_FLEET = 8

_OPEN = Pose(x=0.0, y=-0.185, heading=0.0)
_AT_WALL = Pose(x=0.4525, y=0.0, heading=0.0)
"""20 mm before the wall: every ray is cast, and most sensors see something."""

_CIRCLE, _SPOT, _PUSH = b"D,3,4\n", b"D,4,-4\n", b"D,5,5\n"

Look = Callable[[Emulator], object]


class _Case(NamedTuple):
    """A way of driving and looking.

    Attributes:
        look: what is done to each robot, every so many steps.
        part: what is likely to bound it.
    """

    title: str
    pose: Pose
    drive: bytes
    seconds: float
    every: int
    look: Look
    part: tuple[str, Part]


def _nothing(_: Emulator) -> None:
    pass


def _ask(emulator: Emulator) -> None:
    emulator.write(b"N\n")


_STEPPING: tuple[str, Part] = ("PyBullet's steps", (pybullet, "stepSimulation"))
_RAYS: tuple[str, Part] = ("the sensors' rays", (Infrared, "gaps"))
_RENDERING: tuple[str, Part] = ("PyBullet's renderer", (pybullet, "getCameraImage"))
_CASES = (
    _Case("away from walls", _OPEN, _CIRCLE, 60.0, 1, _nothing, _STEPPING),
    _Case("always in contact with a wall", _AT_WALL, _PUSH, 15.0, 1, _nothing, _STEPPING),
    _Case("at a wall, all eight sensors every 20 ms", _AT_WALL, _SPOT, 30.0, 1, _ask, _RAYS),
    _Case("a camera frame a second", _OPEN, _CIRCLE, 60.0, 50, Emulator.mirror_image, _RENDERING),
    _Case("a camera frame at 10 Hz", _OPEN, _CIRCLE, 10.0, 5, Emulator.mirror_image, _RENDERING),
)


class Simulation:
    """One robot alone."""

    def __init__(self, stack: ExitStack) -> None:
        self._emulator = Emulator(Setup(load_arena("open-box"), baud=None))
        stack.callback(self._emulator.close)
        self._emulator.mirror_image()

    def round(self) -> dict[str, float]:
        """Factor of each case, and the share of what bounds it."""
        found = {}
        for case in _CASES:
            _begin(self._emulator, case)
            found[case.title] = case.seconds / _run([self._emulator], case, case.seconds)
            watch = Stopwatch()
            name, part = case.part
            with watch.watch({name: part}):
                taken = _run([self._emulator], case, case.seconds / 3)
            found[f"{case.title} share"] = watch.seconds[name] / taken
        return found

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """Real-time factors."""
        return [
            Figure(
                f"real-time factor, {case.title}",
                f"{medians[case.title]:,.0f}",
                f"of it {case.part[0]} {100 * medians[case.title + ' share']:.0f} %",
                f"{medians[case.title]:,.0f} x real time",
            )
            for case in _CASES
        ]


class Fleet:
    """Eight robots in one world, each asked for its sensors every 20 ms."""

    def __init__(self, stack: ExitStack) -> None:
        self._robots = make_fleet(Setup(load_arena("open-box"), baud=None), _FLEET)
        stack.callback(self._robots[0].close)
        for robot in self._robots:
            robot.write(_SPOT)

    def round(self) -> dict[str, float]:
        """Factor of the world."""
        case = _Case("", _OPEN, _SPOT, 3.0, 1, _ask, _RAYS)
        return {"fleet": case.seconds / _run(self._robots, case, case.seconds)}

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """Robots that one core carries in real time."""
        factor = medians["fleet"]
        return [
            Figure(
                f"real-time factor, {_FLEET} robots in one world, sensors every 20 ms",
                f"{factor:.0f}",
                f"robots a core in real time, if linear: {factor * _FLEET:.0f}",
                f"{factor:.0f} x real time",
            )
        ]


def _begin(emulator: Emulator, case: _Case) -> None:
    emulator.reset(Reset(pose=case.pose, seed=1))
    emulator.write(case.drive)
    emulator.advance(emulator.now + 1.0)
    emulator.read()


def _run(robots: list[Emulator], case: _Case, seconds: float) -> float:
    """Let simulated seconds pass; returns seconds of the processor."""
    start = process_time()
    for step in range(round(seconds / _STEP)):
        if step % case.every == 0:
            for robot in robots:
                case.look(robot)
        robots[0].advance(robots[0].now + _STEP)
        for robot in robots:
            robot.read()
    return process_time() - start
