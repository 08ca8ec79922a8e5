"""The rigid-body dynamics of a world: PyBullet, with an arena's solids and things in it.

Import it after `bullet.load_physics` only.
"""

from collections.abc import Iterator, Sequence
from math import atan2
from typing import NamedTuple, TypeVar

import numpy as np
import pybullet
from khepera_protocol.serial.units import CONTROL_PERIOD
from numpy.typing import NDArray

from khepera_emulator.arenas.arena import Arena, Cylinder, Lamp
from khepera_emulator.errors import EmulatorError
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.looks import BULB_COLOUR, BULB_HEIGHT, BULB_RADIUS
from khepera_emulator.world.solids import Box
from khepera_emulator.world.things import (
    BODY_GROUP,
    FLOOR_GROUP,
    RAY_GROUP,
    SOLID_GROUP,
    THING_GROUP,
    Thing,
)

PHYSICS_PERIOD = 0.005
"""Seconds between two steps of the rigid-body dynamics; two fit a control period.

Half of it changes a drive by 0.01 %, a turn by 0.1 degree in 860, and a slide along a wall by 2 %.
"""

_T = TypeVar("_T")

_SUBSTEPS = round(CONTROL_PERIOD / PHYSICS_PERIOD)

_MOST_PARTS = 16
"""Shapes that one body may have, to touch or to look at: PyBullet crashes on more."""

_FLOOR_HALF = 11.0
_FLOOR_THICKNESS = 0.1


def _batched(parts: Sequence[_T], size: int) -> Iterator[Sequence[_T]]:
    """Cut a sequence into pieces of a size; the last one may be shorter."""
    return (parts[first : first + size] for first in range(0, len(parts), size))


def _connect() -> int:
    """Begin a physics client.

    Raises:
        EmulatorError: there are as many as PyBullet has room for.
    """
    client: int = pybullet.connect(pybullet.DIRECT)
    if client < 0:
        raise EmulatorError(
            "PyBullet has no room for another world in this process; close some of its robots"
        )
    return client


def hide(body: int, client: int, first: int = -1) -> None:
    """Make links without visual shapes invisible: PyBullet would show their collision shapes.

    Args:
        body: whose links.
        client: of the body.
        first: the first of the links; -1 is the base.
    """
    for link in range(first, pybullet.getNumJoints(body, physicsClientId=client)):
        pybullet.changeVisualShape(body, link, rgbaColor=[0, 0, 0, 0], physicsClientId=client)


class _Part(NamedTuple):
    """A wall's stretch or a post, as PyBullet wants it."""

    kind: int
    halves: list[float]
    radius: float
    height: float
    place: list[float]
    turn: list[float]
    colour: tuple[float, float, float]


def _box_part(box: Box) -> _Part:
    halves = [box.half_length, box.half_thickness, box.height / 2]
    turn = list(pybullet.getQuaternionFromEuler([0, 0, atan2(box.uy, box.ux)]))
    place = [box.x, box.y, box.height / 2]
    return _Part(pybullet.GEOM_BOX, halves, 0.0, 0.0, place, turn, box.colour)


def _post_part(post: Cylinder) -> _Part:
    place = [*post.centre, post.height / 2]
    return _Part(
        pybullet.GEOM_CYLINDER,
        [0.0, 0.0, 0.0],
        post.radius,
        post.height,
        place,
        [0.0, 0.0, 0.0, 1.0],
        post.colour,
    )


class Dynamics:
    """A PyBullet client of its own; close it at the end.

    Args:
        arena: what stands and lies in it.
        plan: the same, from above.
        shared: whether robots see each other, and must have looks.

    Attributes:
        shared: as given.
        client: PyBullet's number of the physics client.
        floor: body that wheels touch.
        solids: bodies that hold all walls and posts.
        things: what robots can push.
        robots: numbers of the robots' bodies.
    """

    def __init__(self, arena: Arena, plan: FloorPlan, *, shared: bool) -> None:
        self.shared = shared
        self.client = _connect()
        pybullet.setGravity(0, 0, -9.81, physicsClientId=self.client)
        pybullet.setTimeStep(PHYSICS_PERIOD, physicsClientId=self.client)
        self.floor = self._add_floor()
        # few bodies for everything that stands: the renderer's time grows with the bodies
        parts = [_box_part(box) for box in plan.boxes]
        parts += [_post_part(post) for post in arena.cylinder]
        self.solids = [self._add_solid(each) for each in _batched(parts, _MOST_PARTS)]
        for lamps in _batched(arena.lamp, _MOST_PARTS):
            self._add_bulbs(lamps)
        self.things = [Thing(part, self.client) for part in arena.object]
        self.robots: set[int] = set()

    def close(self) -> None:
        """End the physics client."""
        if self.client >= 0:
            pybullet.disconnect(self.client)
            self.client = -1

    def step(self) -> None:
        """Let the dynamics advance by one `PHYSICS_PERIOD`."""
        pybullet.stepSimulation(physicsClientId=self.client)

    def period(self) -> None:
        """Let the dynamics advance by one control period."""
        for _ in range(_SUBSTEPS):
            for thing in self.things:
                thing.hold()
            self.step()
            for thing in self.things:
                thing.brake(PHYSICS_PERIOD)

    def cast(self, start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the fraction of each ray, from (N, 3) to (N, 3), that is free; 1 without a hit."""
        hits = pybullet.rayTestBatch(start.tolist(), end.tolist(), physicsClientId=self.client)
        return np.array([hit[2] for hit in hits])

    def _add_floor(self) -> int:
        half = [_FLOOR_HALF, _FLOOR_HALF, _FLOOR_THICKNESS / 2]
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=half, physicsClientId=self.client
        )
        floor: int = pybullet.createMultiBody(
            0, shape, -1, [0, 0, -_FLOOR_THICKNESS / 2], physicsClientId=self.client
        )
        # the camera paints the floor, which would cost the renderer most
        hide(floor, self.client)
        pybullet.changeDynamics(
            floor, -1, lateralFriction=1.0, restitution=0.0, physicsClientId=self.client
        )
        pybullet.setCollisionFilterGroupMask(
            floor, -1, FLOOR_GROUP, FLOOR_GROUP, physicsClientId=self.client
        )
        return floor

    def _add_solid(self, parts: Sequence[_Part]) -> int:
        """Make one body that stands still."""
        kinds = [part.kind for part in parts]
        halves = [part.halves for part in parts]
        radii = [part.radius for part in parts]
        heights = [part.height for part in parts]
        places = [part.place for part in parts]
        turns = [part.turn for part in parts]
        shape = pybullet.createCollisionShapeArray(
            shapeTypes=kinds,
            halfExtents=halves,
            radii=radii,
            lengths=heights,
            collisionFramePositions=places,
            collisionFrameOrientations=turns,
            physicsClientId=self.client,
        )
        look = pybullet.createVisualShapeArray(
            shapeTypes=kinds,
            halfExtents=halves,
            radii=radii,
            lengths=heights,
            visualFramePositions=places,
            visualFrameOrientations=turns,
            rgbaColors=[[*part.colour, 1.0] for part in parts],
            physicsClientId=self.client,
        )
        solid: int = pybullet.createMultiBody(0, shape, look, physicsClientId=self.client)
        pybullet.changeDynamics(
            solid, -1, lateralFriction=0.3, restitution=0.0, physicsClientId=self.client
        )
        pybullet.setCollisionFilterGroupMask(
            solid,
            -1,
            SOLID_GROUP,
            BODY_GROUP | THING_GROUP | RAY_GROUP,
            physicsClientId=self.client,
        )
        return solid

    def _add_bulbs(self, lamps: Sequence[Lamp]) -> None:
        """Add one body that is seen and does not touch anything."""
        count = len(lamps)
        look = pybullet.createVisualShapeArray(
            shapeTypes=[pybullet.GEOM_SPHERE] * count,
            radii=[BULB_RADIUS] * count,
            visualFramePositions=[[*lamp.centre, BULB_HEIGHT] for lamp in lamps],
            rgbaColors=[(*BULB_COLOUR, 1.0)] * count,
            physicsClientId=self.client,
        )
        pybullet.createMultiBody(0, -1, look, physicsClientId=self.client)
