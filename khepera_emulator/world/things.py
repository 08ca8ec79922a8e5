"""Things in an arena that robots push: rigid bodies that slide, or roll, on the floor.

PyBullet moves them and finds what they meet; the floor is not among it. Its solver would put all
friction on one of several points of contact and let a post circle for ever, so that things are
held up here, and braked by dry friction as a plate on a plane is: mu g, and about its axis what
that comes to over the plate. They stay upright, whatever pushes them, and come to rest exactly.
"""

from math import atan2, cos, hypot, radians, sin
from typing import Any

import pybullet
from khepera_protocol.serial.units import CONTROL_PERIOD

from khepera_emulator.arenas.arena import Movable
from khepera_emulator.world.solids import Brick, footprint

RAY_GROUP, SOLID_GROUP, BODY_GROUP, THING_GROUP, FLOOR_GROUP = 1, 2, 4, 8, 16
"""Collision groups: wheels and casters touch the floor only, bodies and things the rest. The first
is that of PyBullet's rays, which cannot be changed."""

_GRAVITY = 9.81
_UPRIGHT = 10.0
"""Inertia in kg m^2 against falling over: as good as infinite."""

_ROLLING = 0.05
"""Rolling resistance of a ball over the friction it would slide with."""

_ROLLING_MASS = 1.4
"""A rolling ball is as hard to speed up as a sliding one of 7/5 of its mass."""

_SIDE_FRICTION = 0.3
"""Of its sides, with walls and bodies."""

_LEVEL = 1e-4
"""Metres that a push may lift or sink a thing before it is put back on the floor."""


class Thing:
    """One movable object in a physics client.

    Attributes:
        body: its number in PyBullet.
        footprint: where it is now, as sensors and bodies meet it.
        moving: whether it slides or rolls by itself.
    """

    def __init__(self, part: Movable, client: int) -> None:
        self.part = part
        self.footprint = footprint(part)
        self.heading = radians(part.heading)
        self.moving = False
        self._client = client
        ball = part.shape == "ball"
        self._rise = part.radius or 0.0 if ball else part.height / 2
        self._mass = part.mass * (_ROLLING_MASS if ball else 1.0)
        self._braking = part.friction * _GRAVITY * (_ROLLING if ball else 1.0)
        # a disc: two thirds of its radius is where friction acts, the square mean is r^2 / 2
        width, length = part.size or (2 * (part.radius or 0.0),) * 2
        arm = 0.38 * (width * length) ** 0.5 if part.size else (part.radius or 0.0) * 2 / 3
        square = (width**2 + length**2) / 12 if part.size else (part.radius or 0.0) ** 2 / 2
        self._turn_braking = self._braking * arm / square
        self.body = self._build(self._mass * square)
        self.let_touch(touch=True)

    def place(self, x: float, y: float) -> None:
        """Put it somewhere else, at rest; metres."""
        self.moving = False
        self.footprint.x, self.footprint.y = x, y
        self.footprint.reach = 0.0
        pybullet.resetBasePositionAndOrientation(
            self.body,
            [x, y, self._rise],
            [0.0, 0.0, sin(self.heading / 2), cos(self.heading / 2)],
            physicsClientId=self._client,
        )
        pybullet.resetBaseVelocity(self.body, [0.0] * 3, [0.0] * 3, physicsClientId=self._client)

    def let_touch(self, *, touch: bool) -> None:
        """Let it meet bodies and rays, or let all pass it."""
        mask = SOLID_GROUP | BODY_GROUP | THING_GROUP | RAY_GROUP
        pybullet.setCollisionFilterGroupMask(
            self.body,
            -1,
            THING_GROUP if touch else 0,
            mask if touch else 0,
            physicsClientId=self._client,
        )

    def hold(self) -> None:
        """Hold it up for one step of the dynamics, in place of the floor."""
        pybullet.applyExternalForce(
            self.body,
            -1,
            [0.0, 0.0, self._mass * _GRAVITY],
            [self.footprint.x, self.footprint.y, self._rise],
            pybullet.WORLD_FRAME,
            physicsClientId=self._client,
        )

    def brake(self, seconds: float) -> None:
        """Take in where the step of the dynamics has moved it, and let friction act."""
        (vx, vy, _), (_, _, wz) = pybullet.getBaseVelocity(self.body, physicsClientId=self._client)
        self._read()
        speed = hypot(vx, vy)
        left = max(speed - self._braking * seconds, 0.0)
        share = left / speed if speed > 0.0 else 0.0
        turn = max(abs(wz) - self._turn_braking * seconds, 0.0) * (1.0 if wz > 0.0 else -1.0)
        self.moving = left > 0.0 or turn != 0.0
        self.footprint.reach = 1.1 * left * CONTROL_PERIOD
        pybullet.resetBaseVelocity(
            self.body,
            [vx * share, vy * share, 0.0],
            [0.0, 0.0, turn],
            physicsClientId=self._client,
        )

    def _read(self) -> None:
        (x, y, z), (_, _, qz, qw) = pybullet.getBasePositionAndOrientation(
            self.body, physicsClientId=self._client
        )
        self.heading = 2.0 * atan2(qz, qw)
        self.footprint.x, self.footprint.y = x, y
        if isinstance(self.footprint, Brick):
            self.footprint.turn(self.heading)
        if abs(z - self._rise) > _LEVEL:
            pybullet.resetBasePositionAndOrientation(
                self.body,
                [x, y, self._rise],
                [0.0, 0.0, sin(self.heading / 2), cos(self.heading / 2)],
                physicsClientId=self._client,
            )

    def _build(self, inertia: float) -> int:
        part, client = self.part, self._client
        kind, measures, look = self._shape()
        shape = pybullet.createCollisionShape(kind, **measures, physicsClientId=client)
        seen = pybullet.createVisualShape(
            kind, **look, rgbaColor=[*part.colour, 1.0], physicsClientId=client
        )
        body: int = pybullet.createMultiBody(
            self._mass,
            shape,
            seen,
            [*part.centre, self._rise],
            [0.0, 0.0, sin(self.heading / 2), cos(self.heading / 2)],
            physicsClientId=client,
        )
        pybullet.changeDynamics(
            body,
            -1,
            lateralFriction=_SIDE_FRICTION,
            restitution=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            localInertiaDiagonal=[_UPRIGHT, _UPRIGHT, inertia],
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=client,
        )
        return body

    def _shape(self) -> tuple[int, dict[str, Any], dict[str, Any]]:
        """Return PyBullet's kind of shape, and its measures, to touch and to look at."""
        part = self.part
        if part.size is not None:
            box = {"halfExtents": [part.size[0] / 2, part.size[1] / 2, part.height / 2]}
            return pybullet.GEOM_BOX, box, box
        if part.shape == "ball":
            ball = {"radius": part.radius}
            return pybullet.GEOM_SPHERE, ball, ball
        return (
            pybullet.GEOM_CYLINDER,
            {"radius": part.radius, "height": part.height},
            {"radius": part.radius, "length": part.height},
        )
