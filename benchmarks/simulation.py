"""Simulated time over processor time of robots in an open box, in the caller's process.

Processor time, so that other programs on the machine do not count: what a core of its own gives.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from time import process_time
from typing import NamedTuple

from figures import Figure
from khepera_protocol.zenoh.payloads import Pose, Reset
from stopwatch import Part, Stopwatch

from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.body.contact import Contact
from khepera_emulator.body.motors import Wheel
from khepera_emulator.robot.emulator import Emulator, Setup, make_fleet
from khepera_emulator.senses.infrared import Infrared
from khepera_emulator.senses.renderers.layered import LayeredRenderer

STEP = 0.020
"""Seconds of simulated time between two looks at the robot."""

_FLEETS = (8, 64)

_OPEN = Pose(x=0.0, y=-0.185, heading=0.0)
AT_WALL = Pose(x=0.4525, y=0.0, heading=0.0)
"""20 mm before the wall: every ray is cast, and most sensors see something."""

_CIRCLE, SPOT, _PUSH = b"D,3,4\n", b"D,4,-4\n", b"D,5,5\n"

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


def ask(emulator: Emulator) -> None:
    """Put a request for the proximity sensors on the line."""
    emulator.write(b"N\n")


_WHEELS: tuple[str, Part] = ("the wheels' controllers", (Wheel, "control"))
_PUSHING: tuple[str, Part] = ("the impulses at the wall", (Contact, "push"))
_RAYS: tuple[str, Part] = ("the sensors' rays", (Infrared, "gaps"))
_RENDERING: tuple[str, Part] = ("the renderer", (LayeredRenderer, "render"))
_CASES = (
    _Case("away from walls", _OPEN, _CIRCLE, 60.0, 1, _nothing, _WHEELS),
    _Case("always in contact with a wall", AT_WALL, _PUSH, 30.0, 1, _nothing, _PUSHING),
    _Case("at a wall, all eight sensors every 20 ms", AT_WALL, SPOT, 30.0, 1, ask, _RAYS),
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


class Fleets:
    """Robots in one world, each asked for its sensors every 20 ms."""

    def __init__(self, stack: ExitStack) -> None:
        self._fleets = []
        for size in _FLEETS:
            robots = make_fleet(Setup(load_arena("open-box"), baud=None), size)
            stack.callback(robots[0].close)
            for robot in robots:
                robot.write(SPOT)
            self._fleets.append(robots)

    def round(self) -> dict[str, float]:
        """Factor of each world."""
        case = _Case("", _OPEN, SPOT, 24.0, 1, ask, _RAYS)
        found = {}
        for robots in self._fleets:
            seconds = case.seconds / len(robots)
            found[f"{len(robots)}"] = seconds / _run(robots, case, seconds)
        return found

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """Robots that one core carries in real time."""
        return [
            Figure(
                f"real-time factor, {size} robots in one world, sensors every 20 ms",
                f"{medians[str(size)]:.1f}",
                f"robots times factor: {medians[str(size)] * size:.0f}",
                f"{medians[str(size)]:.1f} x real time",
            )
            for size in _FLEETS
        ]


def _begin(emulator: Emulator, case: _Case) -> None:
    emulator.reset(Reset(pose=case.pose, seed=1))
    emulator.write(case.drive)
    emulator.advance(emulator.now + 1.0)
    emulator.read()


def _run(robots: list[Emulator], case: _Case, seconds: float) -> float:
    """Let simulated seconds pass; returns seconds of the processor."""
    start = process_time()
    for step in range(round(seconds / STEP)):
        if step % case.every == 0:
            for robot in robots:
                case.look(robot)
        robots[0].advance(robots[0].now + STEP)
        for robot in robots:
            robot.read()
    return process_time() - start
