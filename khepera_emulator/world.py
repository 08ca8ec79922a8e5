"""The PyBullet world: one physics client, an arena's solids, and what they look like."""

from math import atan2

import numpy as np
import pybullet
from numpy.typing import NDArray

from khepera_emulator.arena import Arena
from khepera_emulator.geometry import FloorPlan

PHYSICS_PERIOD = 0.005
"""Seconds between two steps of the rigid-body dynamics; two fit a control period.

Half of it changes a drive by 0.01 %, a turn by 0.1 degree in 860, and a slide along a wall by 2 %.
"""

FLOOR_GROUP, SOLID_GROUP, BODY_GROUP = 1, 2, 4
"""Collision groups: wheels and casters touch the floor only, bodies the rest."""

_RAY_GROUP = 1
"""The group of PyBullet's rays, which cannot be changed; wheels do not look for solids."""

_FLOOR_HALF = 11.0
_FLOOR_THICKNESS = 0.1


def hide(body: int, client: int) -> None:
    """Make a body without visual shapes invisible: PyBullet would show its collision shapes."""
    for link in range(-1, pybullet.getNumJoints(body, physicsClientId=client)):
        pybullet.changeVisualShape(body, link, rgbaColor=[0, 0, 0, 0], physicsClientId=client)


class World:
    """An arena in a PyBullet client of its own; use as a context, or close it.

    Attributes:
        arena: what stands in it.
        plan: the same from above, for rays and free space.
        client: PyBullet's number of the physics client.
        solids: body that holds all walls and posts, or None in an empty arena.
    """

    def __init__(self, arena: Arena) -> None:
        self.arena = arena
        self.plan = FloorPlan(arena)
        self.client: int = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0, 0, -9.81, physicsClientId=self.client)
        pybullet.setTimeStep(PHYSICS_PERIOD, physicsClientId=self.client)
        self.floor = self._add_floor()
        self.solids = self._add_solids()

    def close(self) -> None:
        """End the physics client."""
        if self.client >= 0:
            pybullet.disconnect(self.client)
            self.client = -1

    def step(self) -> None:
        """Let the dynamics advance by one `PHYSICS_PERIOD`."""
        pybullet.stepSimulation(physicsClientId=self.client)

    def cast(self, start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
        """Fraction of each ray, from (N, 3) to (N, 3), that is free; 1 without a hit."""
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

    def _add_solids(self) -> int | None:
        # one body for everything that stands: the renderer's time grows with the bodies
        kinds: list[int] = []
        halves: list[list[float]] = []
        radii: list[float] = []
        heights: list[float] = []
        places: list[list[float]] = []
        turns: list[list[float]] = []
        colours: list[list[float]] = []
        for box in self.plan.boxes:
            kinds.append(pybullet.GEOM_BOX)
            halves.append([box.half_length, box.half_thickness, box.height / 2])
            radii.append(0.0)
            heights.append(0.0)
            places.append([box.x, box.y, box.height / 2])
            turns.append(list(pybullet.getQuaternionFromEuler([0, 0, atan2(box.uy, box.ux)])))
            colours.append([*box.colour, 1.0])
        for post in self.arena.cylinder:
            kinds.append(pybullet.GEOM_CYLINDER)
            halves.append([0.0, 0.0, 0.0])
            radii.append(post.radius)
            heights.append(post.height)
            places.append([*post.centre, post.height / 2])
            turns.append([0.0, 0.0, 0.0, 1.0])
            colours.append([*post.colour, 1.0])
        if not kinds:
            return None
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
            rgbaColors=colours,
            physicsClientId=self.client,
        )
        solids: int = pybullet.createMultiBody(0, shape, look, physicsClientId=self.client)
        pybullet.changeDynamics(
            solids, -1, lateralFriction=0.3, restitution=0.0, physicsClientId=self.client
        )
        pybullet.setCollisionFilterGroupMask(
            solids, -1, SOLID_GROUP, BODY_GROUP | _RAY_GROUP, physicsClientId=self.client
        )
        return solids
