"""The emulated robots of one world, and their common time."""

from collections.abc import Iterator
from functools import cached_property
from heapq import merge
from math import hypot
from typing import Any, Protocol

from khepera_protocol.serial.units import CONTROL_PERIOD
from khepera_protocol.zenoh.payloads import Pose

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.uart import Uart
from khepera_emulator.robot.periods import is_moving, run_periods
from khepera_emulator.robot.rolling import Rolling
from khepera_emulator.turrets.radio import RadioMedium
from khepera_emulator.world.enclosure import Enclosure
from khepera_emulator.world.floor_plan import Surroundings
from khepera_emulator.world.free_space import Gap, check_room
from khepera_emulator.world.solids import Disc, Footprint, footprint
from khepera_emulator.world.world import World


class Member(Protocol):
    """One robot of a fleet; see `emulator.Emulator`."""

    now: float
    uart: Uart
    start_pose: Pose

    @property
    def robot(self) -> Any:
        """The robot, as its firmware finds it."""

    @property
    def radius(self) -> float:
        """Of its body, in metres."""

    def execute(self, line: Any, moment: float) -> None:
        """Carry out a request."""

    def put_anew(self, seed: int) -> None:
        """Be put at the start of a world that was made anew, all chance anew from a seed."""


class Fleet:
    """Robots that share a world; time passes for all of them together.

    Args:
        arena: where they are.
        radius: of the widest of their bodies, in metres.
        size: how many they will be.
        rigid: whether they are rigid bodies all the time; see `world.World`.

    Attributes:
        now: time that everything has been brought to, in seconds; a multiple of `uart.GRID`.
        world: where they are; another one after `renew`.
        radio: the air between their radio turrets.
        members: the robots, in the order in which they do what happens at the same time.
        power_time: when control periods began to be counted.
    """

    def __init__(self, arena: Arena, radius: float, size: int = 1, *, rigid: bool = False) -> None:
        self.now = 0.0
        self.members: list[Member] = []
        self.radio = RadioMedium()
        self._arena = arena
        self._radius = radius
        self._shared, self._rigid = size > 1, rigid
        self.world = self._make_world()
        self._robots: list[Rolling] = []
        self.power_time = 0.0
        self._ticks = 0

    def close(self) -> None:
        """Give back the world."""
        self.world.close()

    @property
    def moving(self) -> bool:
        """True if anything moves, or is driven."""
        return is_moving(self.world, self._robots)

    def join(self, member: Member) -> None:
        """Add a robot, which is in the world already."""
        self.members.append(member)
        self.assemble()

    def renew(self) -> None:
        """Make the world anew, with nothing in it but the arena; then put the robots in it.

        Control periods are counted from now.
        """
        before, self.world = self.world, self._make_world()
        before.close()
        self.power_time = self.now
        self._ticks = 0

    def assemble(self) -> None:
        """Take the robots that the members have put into the world."""
        self._robots = [member.robot for member in self.members]

    def advance(self, until: float) -> None:
        """Let time pass: drive, carry out the requests that arrive, answer them.

        Args:
            until: seconds on the grid of `uart.GRID`, not before `now`.
        """
        members = self.members
        if len(members) == 1:
            (member,) = members
            for moment, line in member.uart.requests(until):
                self._drive(moment)
                member.execute(line, moment)
            member.now = until
        else:
            lines = [_numbered(k, each, until) for k, each in enumerate(members)]
            for moment, number, line in merge(*lines):
                self._drive(moment)
                members[number].execute(line, moment)
            for member in members:
                member.now = until
        self._drive(until)
        self.now = until

    def passed(self, now: float, ticks: int) -> None:
        """Take note of time that has passed for the only member, whose control periods are done."""
        (member,) = self.members
        member.now = self.now = now
        self._ticks = ticks

    def gap(self, radius: float, own: Footprint | None = None) -> Gap:
        """Return distances from a robot's body to the nearest thing, as everything stands now.

        Args:
            radius: of that body.
            own: that body, if it is in the world already.
        """
        scene = self.world.scene(own)
        return lambda pose: scene.clearance(pose.x, pose.y) - radius

    def gap_at_start(self, own: Member) -> Gap:
        """Return the same with all things, and all robots but one, where they start."""
        starts = [(each.start_pose, each.radius) for each in self.members if each is not own]
        movers: list[Footprint] = [footprint(part) for part in self._arena.object]
        movers += [Disc(pose.x, pose.y, radius, 0.0) for pose, radius in starts]
        scene = Surroundings(self.world.plan, movers)
        return lambda pose: scene.clearance(pose.x, pose.y) - own.radius

    def push(self, number: int, x: float, y: float) -> None:
        """Put a thing somewhere else, at rest; metres.

        Raises:
            EmulatorError: there is no such thing, a robot holds it, or the place is not free.
        """
        things = self.world.things
        if number >= len(things):
            there = f"there are {len(things)}, from 0 on" if things else "there are none"
            raise EmulatorError(f"there is no thing {number} to push: {there}")
        thing = things[number]
        if thing.footprint not in self.world.movers:
            raise EmulatorError(f"the thing {number} is held by a robot")
        place = Pose(x=x, y=y, heading=0.0)
        scene = self.world.scene(thing.footprint)
        # of a shared world they are in the scene
        others = [] if self._shared else self.members
        poses = [(each.robot.chassis.pose, each.radius) for each in others]
        bodies = [hypot(x - pose.x, y - pose.y) - radius for pose, radius in poses]
        own = thing.footprint
        reach = max(hypot(cx - own.x, cy - own.y) for cx, cy in own.corners())
        check_room(
            place,
            lambda _: min([scene.clearance(x, y), *bodies]) - reach,
            self.enclosure.holds,
            what=f"the thing {number}",
        )
        thing.place(x, y)
        self.world.arrangement += 1

    @cached_property
    def enclosure(self) -> Enclosure:
        """The inside of the arena."""
        return Enclosure(self.world.plan, self._arena.start, self._radius)

    def _make_world(self) -> World:
        return World(self._arena, shared=self._shared, rigid=self._rigid)

    def _drive(self, until: float) -> None:
        due = int((until - self.power_time) / CONTROL_PERIOD + 1e-6)
        if due > self._ticks:
            self._ticks = due
            run_periods(self.world, self._robots, due)


def _numbered(number: int, member: Member, until: float) -> Iterator[tuple[float, int, Any]]:
    for moment, line in member.uart.requests(until):
        yield moment, number, line
