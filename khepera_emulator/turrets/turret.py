"""The interface between a robot and its turrets.

A turret is told the robot's time and answers messages; it does no I/O. `step` brings it up to
a time, and is called at every control period in which the robot moves, and before every
message: a turret may rely on the robot's place being the one of that time.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin
from typing import Protocol, runtime_checkable

from khepera_protocol.serial.turrets import TurretKind
from khepera_protocol.serial.units import CONTROL_PERIOD

from khepera_emulator.world.rays import Array

Point = tuple[float, float]
Place = tuple[float, float, float]
"""x and y in metres, heading in radians."""

Values = tuple[int, ...]


class Rays(Protocol):
    """Scenery that rays are cast into: see `floor_plan.FloorPlan.cast`."""

    def cast(self, origins: Array, directions: Array, /) -> tuple[Array, Array]:
        """Return distances in metres and grey values from 0 to 1 of what each ray hits first."""


@dataclass(frozen=True, slots=True)
class Piece:
    """Something between two fingers.

    Attributes:
        number: tells a thing that can be lifted from others; None for what stands fast.
        width: metres that hold the fingers apart.
        resistivity: reading when the fingers touch it, 1 to 255.
    """

    number: int | None
    width: float
    resistivity: int


class Things(Protocol):
    """Things to grasp in the world around a robot."""

    def between(self, left: Point, right: Point, /) -> Piece | None:
        """Find what stands between two points on the floor plan, in metres."""

    def lift(self, piece: Piece, /) -> bool:
        """Take a thing off the floor; False if it stands fast."""

    def carry(self, piece: Piece, place: Point, /) -> None:
        """Take a lifted thing along to a place, in metres."""

    def put(self, piece: Piece, place: Point, /) -> None:
        """Put a lifted thing down at a place, in metres."""


@dataclass(frozen=True, slots=True)
class Site:
    """Place on a robot that a turret is mounted on.

    Attributes:
        radius: of the robot's body, in metres.
        place: where the robot stands now.
        rays: what can be seen.
        sky: grey, 0 to 1, of what is beyond all solids.
        things: what can be grasped.
    """

    radius: float
    place: Callable[[], Place]
    rays: Rays
    sky: float
    things: Things

    def ahead(self, forward: float, left: float = 0.0) -> Point:
        """Return a point seen from the robot's middle, in metres of the world."""
        x, y, heading = self.place()
        c, s = cos(heading), sin(heading)
        return x + c * forward - s * left, y + s * forward + c * left


class Turret(Protocol):
    """A turret as the robot finds it.

    Attributes:
        kind: its row of the table.
    """

    kind: TurretKind

    def power_on(self) -> None:
        """Begin afresh: the robot was switched on, perhaps elsewhere."""

    def step(self, now: float) -> None:
        """Let time pass up to `now`, in seconds of the robot."""


@runtime_checkable
class MessageTurret(Turret, Protocol):
    """A turret that T addresses by its number."""

    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        """Carry out a message of the turret's table.

        Args:
            letter: of the message.
            arguments: inside the ranges of the table.
            now: seconds of the robot; `step` has been called with it.

        Returns:
            The values of the reply.

        Raises:
            RequestError: an argument that the turret refuses for reasons of its own.
        """


@runtime_checkable
class BusTurret(Turret, Protocol):
    """A turret on the byte bus and the A/D inputs."""

    def read_bus(self, address: int) -> int | None:
        """Return the byte at an address; None where the turret does not answer."""

    def write_bus(self, address: int, data: int) -> None:
        """Take a byte for an address, perhaps another's."""

    def analogue(self, channel: int) -> int | None:
        """Return counts, 0 to 1023, at an A/D channel; None where the turret drives nothing."""


def ticks(now: float) -> int:
    """Return the control period that a time of the robot belongs to."""
    return round(now / CONTROL_PERIOD)
