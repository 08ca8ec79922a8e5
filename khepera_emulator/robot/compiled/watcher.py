"""A robot in the client's process, watched: many exchanges of a silent line at once, compiled."""

from typing import Any, Final, NamedTuple

from khepera_protocol.system.compiled import PlainRuns, load

from khepera_emulator.line.uart import Uart
from khepera_emulator.robot.compiled.layout import Records, Stage
from khepera_emulator.robot.compiled.packing import Packed, is_quick, line_of, stage_of
from khepera_emulator.robot.fleet import Fleet
from khepera_emulator.robot.khepera.robot import Robot

_RUNS: Final = PlainRuns(400)

_AHEAD: Final = 48
"""Rows of random numbers that are ready for a watch, at least."""

_KERNEL: Final = "khepera_emulator.robot.compiled.watching"


class Until(NamedTuple):
    """End of a watch.

    Attributes:
        limit: counts of one of the six sensors at front and sides.
        begin: time from which the duration counts, in seconds.
        duration: seconds after which the motion controllers are asked, too, until both have reached
            their targets.
        patience: seconds after which these are no longer waited for; less than 0: they are not
            asked.
    """

    limit: int
    begin: float
    duration: float
    patience: float


class Watched(NamedTuple):
    """Outcome of a watch.

    Attributes:
        counts: the last proximity scan that was read.
        exchanges: how many there were.
        longest: seconds that the longest of them took.
        elapsed: seconds from the beginning to the reply of that scan.
        told: of each wheel whether it has reached its target, and its error; None: not asked.
    """

    counts: tuple[int, ...]
    exchanges: int
    longest: float
    elapsed: float
    told: tuple[tuple[bool, int], ...] | None


class Watcher:
    """Watches of the robots that an emulator makes one after the other."""

    def __init__(self) -> None:
        self._stage: Stage | None = None
        self._packed: tuple[Robot, Packed] | None = None

    def watch(self, robot: Any, fleet: Fleet, uart: Uart, until: Until) -> Watched | None:
        """Ask for the proximity sensors until something has happened.

        Args:
            robot: alone in its world.
            fleet: of the robot.
            uart: its line.
            until: what has to happen.

        Returns:
            None: it is left to the client, who comes to the same by asking again and again.
        """
        if not (_suits(robot, fleet, uart) and _RUNS.are_enough()):
            return None
        kernel = load(_KERNEL)
        packed, stage = self._pack(robot, fleet)
        line = line_of(uart)
        records = packed.records
        records["now"], records["power_time"] = fleet.now, fleet.power_time
        for name in ("receiver_free", "interpreter_free", "sender_free"):
            records[name] = getattr(uart, name)
        exchanges, longest, end = 0, 0.0, kernel.MORE
        while end == kernel.MORE:
            packed.take()
            slips, noises = robot.slips.ahead(_AHEAD), robot.infrared.noise.ahead(_AHEAD)
            end, asked, long, elapsed = kernel.watch(
                records[0], packed.walls, slips, noises, line, stage, *until
            )
            exchanges, longest = exchanges + asked, max(longest, long)
            packed.give()
        now, *free = (
            records[name].item()
            for name in ("now", "receiver_free", "interpreter_free", "sender_free")
        )
        uart.silent_since(*free)
        fleet.passed(now, robot.ticks)
        counts = tuple(records["counts"][0].tolist())
        return Watched(counts, exchanges, longest, elapsed, _told(end == kernel.TOLD, records))

    def _pack(self, robot: Robot, fleet: Fleet) -> tuple[Packed, Stage]:
        if self._stage is None:
            self._stage = stage_of(fleet.world.plan, robot)
        if self._packed is None or self._packed[0] is not robot:
            self._packed = robot, Packed(robot, len(self._stage.solids))
        return self._packed[1], self._stage


def _told(asked: bool, records: Records) -> tuple[tuple[bool, int], ...] | None:
    if not asked:
        return None
    reached, errors = (records[name][0].tolist() for name in ("told_reached", "told_error"))
    return tuple((bool(there), error) for there, error in zip(reached, errors, strict=True))


def _suits(robot: Any, fleet: Fleet, uart: Uart) -> bool:
    """Tell whether a robot is alone with walls, on a silent line that is as it should be."""
    if not isinstance(robot, Robot):
        return False
    alone = len(fleet.members) == 1 and fleet.world.dynamics is None
    plain = not robot.turrets and robot.ailments is None and robot.dead_man is None
    return alone and plain and is_quick(uart.baud) and uart.silent(fleet.now)
