"""A robot's body on its wheels: exact kinematics in the open, PyBullet's dynamics at contacts.

Away from everything else nothing but the wheels acts on the body, and the pose follows from the
ways of the two wheels exactly. As soon as the body could touch something within a control
period, the same wheels drive a rigid body in PyBullet instead: two wheels with friction, two
frictionless casters, a body that pushes, slides and stalls. (Measured: on a free floor the two
agree to 0.2 %; see tests/test_chassis.py.)
"""

from math import cos, pi, sin

import pybullet

from khepera_emulator.models import Model
from khepera_emulator.world import (
    BODY_GROUP,
    FLOOR_GROUP,
    PHYSICS_PERIOD,
    SOLID_GROUP,
    World,
    hide,
)
from protocol.side_channel import Pose, WheelDrift
from protocol.units import CONTROL_PERIOD

_CASTER_RADIUS = 0.003
_CASTER_OFFSET = 0.022
_GROUND_CLEARANCE = 0.003
_CONTACT_MARGIN = 0.002
"""Gap in metres below which the dynamics take over, on top of what the next period can bring."""

_WHEELS = (0, 1)
_LEAST_GRIP = 0.2
"""Least part of a wheel's way that reaches the ground, however large the slip that was drawn."""

_SUBSTEPS = round(CONTROL_PERIOD / PHYSICS_PERIOD)


class Chassis:
    """The body of one robot.

    Attributes:
        pose: where it stands.
        contact: whether it touched something in the last period.
    """

    def __init__(self, world: World, model: Model, drift: WheelDrift, pose: Pose) -> None:
        self._world = world
        self._model = model
        self._drift = drift
        self._client = world.client
        self._body = self._build()
        self._wheel_angles = (0.0, 0.0)
        self._dynamic = False
        self.contact = False
        self.x, self.y, self.heading = pose.x, pose.y, pose.heading
        self.ground_speed = (0.0, 0.0)
        self._free_way = 0.0
        self.place(pose)

    @property
    def pose(self) -> Pose:
        """Position of the middle between the wheels, and heading in -pi to pi."""
        return Pose(x=self.x, y=self.y, heading=(self.heading + pi) % (2 * pi) - pi)

    def place(self, pose: Pose) -> None:
        """Put the robot down at rest."""
        self.x, self.y, self.heading = pose.x, pose.y, pose.heading
        self.contact = False
        self.ground_speed = (0.0, 0.0)
        self._dynamic = False
        self._free_way = 0.0
        self._sync(0.0, 0.0)

    def roll(self, ways: tuple[float, float], slip: tuple[float, float]) -> tuple[float, float]:
        """Turn the wheels for one control period.

        Args:
            ways: counted way that the motors give the two wheels, in metres.
            slip: relative error of each wheel's way over ground in this period.

        Returns:
            The ways that the wheels really turned: less when something holds them.
        """
        left = self._drift.left_scale * max(1.0 + slip[0], _LEAST_GRIP)
        right = self._drift.right_scale * max(1.0 + slip[1], _LEAST_GRIP)
        ground = (ways[0] * left, ways[1] * right)
        reach = max(abs(ground[0]), abs(ground[1]))
        if self._free_way < reach + _CONTACT_MARGIN:
            gap = self._world.plan.clearance(self.x, self.y) - self._model.radius
            self._free_way = gap
            if gap < reach + _CONTACT_MARGIN:
                turned = self._push(ground)
                return (turned[0] / left, turned[1] / right)
        self._dynamic = False
        self.contact = False
        self._free_way -= reach
        self._glide(ground)
        return ways

    def _glide(self, ground: tuple[float, float]) -> None:
        # exact integration over the period: both wheels on arcs about a common centre
        way = (ground[0] + ground[1]) / 2
        turn = (ground[1] - ground[0]) / self._drift.wheel_base
        half = turn / 2
        chord = way * (sin(half) / half if abs(half) > 1e-9 else 1.0)
        self.x += chord * cos(self.heading + half)
        self.y += chord * sin(self.heading + half)
        self.heading += turn
        self.ground_speed = (ground[0] / CONTROL_PERIOD, ground[1] / CONTROL_PERIOD)

    def _push(self, ground: tuple[float, float]) -> tuple[float, float]:
        """One period of rigid-body dynamics; returns the ways the wheels turned over ground."""
        if not self._dynamic:
            self._sync(*self.ground_speed)
            self._dynamic = True
        radius = self._model.wheel_radius
        # a wheel pulls no harder than its tyre holds: half the weight each, friction 1
        force = self._model.mass * 9.81 / 2 * radius
        pybullet.setJointMotorControlArray(
            self._body,
            _WHEELS,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[way / (CONTROL_PERIOD * radius) for way in ground],
            forces=(force, force),
            physicsClientId=self._client,
        )
        for _ in range(_SUBSTEPS):
            self._world.step()
        self.contact = self._touches()
        (self.x, self.y, _), turn = pybullet.getBasePositionAndOrientation(
            self._body, physicsClientId=self._client
        )
        heading = pybullet.getEulerFromQuaternion(turn)[2]
        self.heading += (heading - self.heading + pi) % (2 * pi) - pi
        states = pybullet.getJointStates(self._body, _WHEELS, physicsClientId=self._client)
        angles = states[0][0], states[1][0]
        turned = tuple(
            (new - old) * radius for new, old in zip(angles, self._wheel_angles, strict=True)
        )
        self._wheel_angles = angles
        (vx, vy, _), (_, _, rate) = pybullet.getBaseVelocity(
            self._body, physicsClientId=self._client
        )
        forward = vx * cos(self.heading) + vy * sin(self.heading)
        half = rate * self._drift.wheel_base / 2
        self.ground_speed = (forward - half, forward + half)
        return turned[0], turned[1]

    def _touches(self) -> bool:
        solids = self._world.solids
        return solids is not None and bool(
            pybullet.getContactPoints(
                self._body, solids, linkIndexA=-1, physicsClientId=self._client
            )
        )

    def _sync(self, left: float, right: float) -> None:
        """Set the rigid body to the present pose, its wheels turning at given ground speeds."""
        radius = self._model.wheel_radius
        pybullet.resetBasePositionAndOrientation(
            self._body,
            [self.x, self.y, radius],
            pybullet.getQuaternionFromEuler([0.0, 0.0, self.heading]),
            physicsClientId=self._client,
        )
        forward = (left + right) / 2
        pybullet.resetBaseVelocity(
            self._body,
            [forward * cos(self.heading), forward * sin(self.heading), 0.0],
            [0.0, 0.0, (right - left) / self._drift.wheel_base],
            physicsClientId=self._client,
        )
        for wheel, speed in enumerate((left, right)):
            pybullet.resetJointState(
                self._body, wheel, 0.0, speed / radius, physicsClientId=self._client
            )
        self._wheel_angles = (0.0, 0.0)

    def _build(self) -> int:
        model, client = self._model, self._client

        def sphere(radius: float) -> int:
            shape: int = pybullet.createCollisionShape(
                pybullet.GEOM_SPHERE, radius=radius, physicsClientId=client
            )
            return shape

        hull = pybullet.createCollisionShape(
            pybullet.GEOM_CYLINDER,
            radius=model.radius,
            height=model.height - _GROUND_CLEARANCE,
            # the base frame lies on the wheel axle
            collisionFramePosition=[
                0,
                0,
                (model.height + _GROUND_CLEARANCE) / 2 - model.wheel_radius,
            ],
            physicsClientId=client,
        )
        half_base = self._drift.wheel_base / 2
        caster_height = _CASTER_RADIUS - model.wheel_radius
        places = [
            [0, half_base, 0],
            [0, -half_base, 0],
            [_CASTER_OFFSET, 0, caster_height],
            [-_CASTER_OFFSET, 0, caster_height],
        ]
        body: int = pybullet.createMultiBody(
            baseMass=model.mass * 0.8,
            baseCollisionShapeIndex=hull,
            basePosition=[0, 0, model.wheel_radius],
            linkMasses=[model.mass * 0.09, model.mass * 0.09, 0.001, 0.001],
            linkCollisionShapeIndices=[
                sphere(model.wheel_radius),
                sphere(model.wheel_radius),
                sphere(_CASTER_RADIUS),
                sphere(_CASTER_RADIUS),
            ],
            linkVisualShapeIndices=[-1] * 4,
            linkPositions=places,
            linkOrientations=[[0, 0, 0, 1]] * 4,
            linkInertialFramePositions=[[0, 0, 0]] * 4,
            linkInertialFrameOrientations=[[0, 0, 0, 1]] * 4,
            linkParentIndices=[0] * 4,
            linkJointTypes=[pybullet.JOINT_REVOLUTE] * 2 + [pybullet.JOINT_FIXED] * 2,
            linkJointAxis=[[0, 1, 0]] * 4,
            physicsClientId=client,
        )
        # damping and sleep concern the whole body: given together with a link's friction,
        # PyBullet would put that friction on the base
        pybullet.changeDynamics(
            body,
            -1,
            linearDamping=0.0,
            angularDamping=0.0,
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=client,
        )
        for link, friction in ((-1, 0.2), (0, 1.0), (1, 1.0), (2, 0.0), (3, 0.0)):
            pybullet.changeDynamics(
                body, link, lateralFriction=friction, restitution=0.0, physicsClientId=client
            )
            group, mask = (
                (BODY_GROUP, SOLID_GROUP | BODY_GROUP) if link == -1 else (FLOOR_GROUP, FLOOR_GROUP)
            )
            pybullet.setCollisionFilterGroupMask(body, link, group, mask, physicsClientId=client)
        hide(body, client)
        return body
