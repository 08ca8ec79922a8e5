"""The world of robots: an arena, what moves in it, and the dynamics where something is pushed.

Walls and posts need no dynamics: one robot among them goes by its own arithmetic, and PyBullet
need not be there. Things to push, several robots, or the wish for rigid bodies alone bring it in.
"""

from typing import TYPE_CHECKING, Protocol

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.world.bullet import load_physics
from khepera_emulator.world.floor_plan import FloorPlan, Scene, Surroundings
from khepera_emulator.world.looks import Look, thing_look
from khepera_emulator.world.neighbours import Neighbours
from khepera_emulator.world.solids import Footprint

if TYPE_CHECKING:
    from khepera_emulator.world.dynamics import Dynamics
    from khepera_emulator.world.things import Thing


class Shown(Protocol):
    """A robot's body, as others in its world see it and meet it."""

    def show(self) -> None:
        """Put the rigid body where the robot is."""

    def looks(self) -> list[Look]:
        """Return what it looks like, where it is."""


class World:
    """An arena and what moves in it; close it at the end.

    Args:
        arena: what stands in it.
        shared: whether it is for more than one robot, who see and touch each other.
        rigid: whether robots are rigid bodies in PyBullet all the time.

    Attributes:
        arena: what stands in it.
        shared: whether it is for more than one robot.
        rigid: whether robots are rigid bodies all the time.
        plan: what stands still, from above, for rays and free space.
        dynamics: PyBullet's, where anything can be pushed; None where nothing can.
        things: what robots can push.
        movers: footprints of the things, and of all robots of a shared world.
        robots: the robots of a shared world.
        neighbours: the movers, by where they are.

    Raises:
        EmulatorError: it needs PyBullet, which is not installed or has no room.
    """

    def __init__(self, arena: Arena, *, shared: bool = False, rigid: bool = False) -> None:
        self.arena = arena
        self.shared = shared
        self.rigid = rigid
        self.plan = FloorPlan(arena)
        self.dynamics = self._dynamics()
        self.things: list[Thing] = [] if self.dynamics is None else self.dynamics.things
        self.movers: list[Footprint] = [thing.footprint for thing in self.things]
        self.robots: list[Shown] = []
        self.neighbours = Neighbours(self.movers)
        self._arrangement = 0

    @property
    def arrangement(self) -> int:
        """Another number whenever something was put elsewhere from outside."""
        return self._arrangement

    @arrangement.setter
    def arrangement(self, number: int) -> None:
        self._arrangement = number
        self.neighbours.forget()

    def close(self) -> None:
        """End the dynamics."""
        if self.dynamics is not None:
            self.dynamics.close()

    def period(self) -> None:
        """Let the dynamics, if there are any, advance by one control period."""
        if self.dynamics is not None:
            self.dynamics.period()

    def lift(self, thing: "Thing") -> None:
        """Take a thing off the floor: nothing meets it and no ray hits it any more."""
        self.arrangement += 1
        self.movers.remove(thing.footprint)
        thing.let_touch(touch=False)

    def put(self, thing: "Thing") -> None:
        """Put a lifted thing back on the floor, where it has been placed."""
        self.arrangement += 1
        thing.let_touch(touch=True)
        self.movers.append(thing.footprint)

    @property
    def restless(self) -> bool:
        """True if something moves that no robot drives."""
        return any(thing.moving for thing in self.things)

    def scene(self, own: Footprint | None = None) -> Scene:
        """Return what there is to see and to touch, but for one's own body."""
        if not (self.shared or self.things):
            return self.plan
        return Surroundings(self.plan, self.movers, own, self.neighbours.around)

    def looks(self, own: Shown | None = None) -> list[Look]:
        """Return what all that moves looks like, where it is, but for one's own body."""
        looks = [thing_look(thing.part, thing.footprint) for thing in self.things]
        for robot in self.robots:
            if robot is not own:
                looks += robot.looks()
        return looks

    def _dynamics(self) -> "Dynamics | None":
        if self.arena.object:
            reason = "the arena has things to push"
        elif self.shared:
            reason = "robots in one arena push each other"
        elif self.rigid:
            reason = "with `physics` set to `pybullet` a robot is a rigid body"
        else:
            return None
        load_physics(reason)
        from khepera_emulator.world.dynamics import Dynamics

        return Dynamics(self.arena, self.plan, shared=self.shared)
