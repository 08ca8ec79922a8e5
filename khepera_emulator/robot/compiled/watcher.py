"""A robot in the client's process, driven: many exchanges of a silent line at once, compiled."""

from math import ceil
from typing import Any, Final, NamedTuple

import numpy as np
from khepera_protocol.serial.units import CONTROL_PERIOD
from khepera_protocol.system.compiled import Kernel
from numpy.typing import NDArray

from khepera_emulator.line.uart import Uart
from khepera_emulator.robot.compiled.layout import MORE, Stage
from khepera_emulator.robot.compiled.packing import Packed, is_quick, line_of, stage_of
from khepera_emulator.robot.fleet import Fleet
from khepera_emulator.robot.khepera.robot import Robot

_AHEAD: Final = 48
"""Rows of random numbers that are ready for a watch, at least."""

_BESIDES: Final = 160
"""Control periods that the exchanges before and after an arc take, at most."""

_WATCH: Final = Kernel("khepera_emulator.robot.compiled.watching:watch", 400)
_DRIVE: Final = Kernel("khepera_emulator.robot.compiled.arcs:drive_arc", 400)

_LINE: Final = ("receiver_free", "interpreter_free", "sender_free")

_PROFILES: Final = (2, 2)


class Arc(NamedTuple):
    """An arc, and what ends it.

    Attributes:
        profile: top speed and acceleration of the left wheel, then of the right one.
        target: counter values of both wheels.
        limit: counts of one of the six sensors at front and sides that are a collision.
        duration: seconds after which the motion controllers are asked, too, until both have reached
            their targets.
        patience: seconds after these for which that is waited for.
    """

    profile: tuple[int, int, int, int]
    target: tuple[int, int]
    limit: int
    duration: float
    patience: float


class Watched(NamedTuple):
    """Outcome of a watch.

    Attributes:
        counts: the last proximity scan that was read.
        exchanges: how many there were.
        longest: seconds that the longest of them took.
    """

    counts: tuple[int, ...]
    exchanges: int
    longest: float


class Driven(NamedTuple):
    """Outcome of an arc.

    Attributes:
        watched: the exchanges.
        collided: whether it was cut short, and the robot stopped.
        counters: encoder counters of both wheels at the end.
    """

    watched: Watched
    collided: bool
    counters: tuple[int, int]


class Watcher:
    """Watches and drives of the robots that an emulator makes one after the other."""

    def __init__(self) -> None:
        self._stage: Stage | None = None
        self._packed: tuple[Robot, Packed] | None = None
        self._counters: NDArray[np.int64] = np.zeros(2, np.int64)

    def watch(
        self, robot: Any, fleet: Fleet, uart: Uart, limit: int, until: float
    ) -> Watched | None:
        """Ask for the proximity sensors until one reads so much, or a time has come.

        Args:
            robot: alone in its world.
            fleet: of the robot.
            uart: its line.
            limit: counts of one of the six sensors at front and sides.
            until: seconds on the robot's clock.

        Returns:
            None: it is left to the client, who comes to the same by asking again and again.
        """
        if not (_suits(robot, fleet, uart) and _WATCH.is_due()):
            return None
        packed, stage = self._pack(robot, fleet, uart)
        exchanges, longest, end = 0, 0.0, MORE
        while end == MORE:
            slips, noises = robot.slips.ahead(_AHEAD), robot.infrared.noise.ahead(_AHEAD)
            world = packed.record, packed.walls, slips, noises, line_of(uart), stage
            arguments = *world, limit, 0.0, until, -1.0
            if not _WATCH.is_made(*arguments):
                return None
            end, asked, long, _ = _WATCH(*arguments)
            exchanges, longest = exchanges + asked, max(longest, long)
            packed.give()
        self._pass(packed, fleet, uart)
        return Watched(packed.counts, exchanges, longest)

    def drive(self, robot: Any, fleet: Fleet, uart: Uart, arc: Arc) -> Driven | None:
        """Drive an arc to its end, or to a collision; then ask for the counters.

        Args:
            robot: alone in its world.
            fleet: of the robot.
            uart: its line.
            arc: what is driven.

        Returns:
            None: it is left to the client, who comes to the same request by request.
        """
        if not (_suits(robot, fleet, uart) and _DRIVE.is_due()):
            return None
        packed, stage = self._pack(robot, fleet, uart)
        periods = ceil((arc.duration + arc.patience) / CONTROL_PERIOD) + _BESIDES
        arguments = (
            packed.record,
            packed.walls,
            robot.slips.ahead(periods),
            robot.infrared.noise.ahead(periods),
            line_of(uart),
            stage,
            np.array(arc.profile).reshape(_PROFILES),
            np.array(arc.target),
            self._counters,
            arc.limit,
            arc.duration,
            arc.patience,
        )
        if not _DRIVE.is_made(*arguments):
            return None
        collided, exchanges, longest = _DRIVE(*arguments)
        packed.give()
        self._pass(packed, fleet, uart)
        left, right = self._counters.tolist()
        return Driven(Watched(packed.counts, exchanges, longest), collided, (left, right))

    def _pack(self, robot: Robot, fleet: Fleet, uart: Uart) -> tuple[Packed, Stage]:
        """Take over what the robot and its line are like."""
        if self._stage is None:
            self._stage = stage_of(fleet.world.plan, robot)
        if self._packed is None or self._packed[0] is not robot:
            self._packed = robot, Packed(robot, len(self._stage.solids))
        packed = self._packed[1]
        packed.take()
        record = packed.record
        record["now"], record["power_time"] = fleet.now, fleet.power_time
        for name in _LINE:
            record[name] = getattr(uart, name)
        return packed, self._stage

    def _pass(self, packed: Packed, fleet: Fleet, uart: Uart) -> None:
        """Let the time of exchanges that are over have passed for the line and the world."""
        record = packed.record
        uart.silent_since(*(record[name].item() for name in _LINE))
        fleet.passed(record["now"].item(), record["ticks"].item())


def _suits(robot: Any, fleet: Fleet, uart: Uart) -> bool:
    """Tell whether a robot is alone with walls, on a silent line that is as it should be."""
    if not isinstance(robot, Robot):
        return False
    alone = len(fleet.members) == 1 and fleet.world.dynamics is None
    plain = not robot.turrets and robot.ailments is None and robot.dead_man is None
    return alone and plain and is_quick(uart.baud) and uart.silent(fleet.now)
