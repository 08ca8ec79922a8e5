"""A robot's body on its wheels: exact kinematics in the open, PyBullet's dynamics at contacts.

Away from everything else nothing but the wheels acts on the body, and the pose follows from the
ways of the two wheels exactly. As soon as the body could touch something within a control
period, the same wheels drive a rigid body in PyBullet instead: two wheels with friction, two
frictionless casters, a body that pushes, slides and stalls. (Measured: on a free floor the two
agree to 0.2 %; see tests/test_chassis.py.) Where other things move, `crew` brings all robots
through a period together.
"""

from math import cos, pi, sin

import pybullet

from khepera_emulator.geometry import Surroundings
from khepera_emulator.models import Model
from khepera_emulator.solids import Disc
from khepera_emulator.world import (
    BODY_GROUP,
    FLOOR_GROUP,
    SOLID_GROUP,
    THING_GROUP,
    World,
    hide,
)
from protocol.side_channel import Pose, WheelDrift
from protocol.units import CONTROL_PERIOD, PULSE

_CASTER_RADIUS = 0.003
_CASTER_OFFSET = 0.022
_CASTER_LIFT = 0.0002
"""Metres that the casters hang above the floor where robots push each other: on four feet at once
it would be the solver's choice how much of the weight, and so of the grip, the wheels have."""

_GROUND_CLEARANCE = 0.003
_CONTACT_MARGIN = 0.002
"""Gap in metres below which the dynamics take over, on top of what the next period can bring."""

_WHEELS = (0, 1)
_LEAST_GRIP = 0.2
"""Least part of a wheel's way that reaches the ground, however large the slip that was drawn."""

_STALL = 0.75
"""Pull of a stalling motor over what its tyre holds, where robots push each other (a choice)."""

_GREY = 120 / 255
"""How bright a robot is to infrared (KiKS)."""

_HULL_COLOUR = (0.25, 0.27, 0.30)
_MAST_RADIUS, _MAST_HEIGHT = 0.012, 0.055
"""The camera's mast on a robot's back, which the others see."""


class Chassis(Disc):
    """The body of one robot: a disc from above.

    Attributes:
        pose: where it stands.
        contact: whether it touched something in the last period.
        scene: what there is for it to see and to touch.
    """

    def __init__(self, world: World, model: Model, drift: WheelDrift, pose: Pose) -> None:
        super().__init__(pose.x, pose.y, model.radius, _GREY)
        self._world = world
        self._model = model
        self._left_scale, self._right_scale = drift.left_scale, drift.right_scale
        self._wheel_base = drift.wheel_base
        self._client = world.client
        self.scene = world.scene(self)
        # None in a world where nothing else moves: nothing to look out for
        self._surroundings = self.scene if isinstance(self.scene, Surroundings) else None
        self.body = self._build()
        if world.shared:
            world.movers.append(self)
            world.robots.append(self)
        self._wheel_angles = (0.0, 0.0)
        self._dynamic = False
        self._pressed = False
        self.contact = False
        self.heading = pose.heading
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
        self._dynamic = self._pressed = False
        self._free_way = 0.0
        self.reach = 0.0
        self.show()

    def roll(self, ways: tuple[float, float], slip: tuple[float, float]) -> tuple[float, float]:
        """Turn the wheels for one control period in a world where nothing else moves.

        Args:
            ways: counted way that the motors give the two wheels, in metres.
            slip: relative error of each wheel's way over ground in this period.

        Returns:
            The ways that the wheels really turned: less when something holds them.
        """
        self.aim(ways, slip)
        # the first of the two questions is asked here, too: it is the only one most of the time
        if self._free_way < self.reach + _CONTACT_MARGIN and self.may_touch():
            self.drive()
            self._world.period()
            return self.arrive()
        return self.glide()

    def aim(self, ways: tuple[float, float], slip: tuple[float, float]) -> None:
        """Say what the wheels shall do in the next control period; see `roll`.

        Then `glide`, or `drive`, `World.period` and `arrive`.
        """
        grip_left, grip_right = 1.0 + slip[0], 1.0 + slip[1]
        left = self._left_scale * (grip_left if grip_left > _LEAST_GRIP else _LEAST_GRIP)
        right = self._right_scale * (grip_right if grip_right > _LEAST_GRIP else _LEAST_GRIP)
        self._ways = ways
        self._scales = left, right
        self._ground = ground_left, ground_right = ways[0] * left, ways[1] * right
        reach_left, reach_right = abs(ground_left), abs(ground_right)
        self.reach = reach_left if reach_left > reach_right else reach_right

    def may_touch(self) -> bool:
        """Whether the body could touch something within the period; all must have aimed."""
        if self._free_way < self.reach + _CONTACT_MARGIN:
            self._free_way = self._world.plan.clearance(self.x, self.y) - self.radius
            if self._free_way < self.reach + _CONTACT_MARGIN:
                return True
        if self._surroundings is None:
            return False
        reach = self.radius + self.reach + _CONTACT_MARGIN
        for mover in self._surroundings.others():
            if mover.gap(self.x, self.y) < reach + mover.reach:
                self._free_way = 0.0  # who knows where it will be pushed
                return True
        return False

    def glide(self) -> tuple[float, float]:
        """Go the way that was aimed at, as nothing can be in it; returns the wheels' ways."""
        self._dynamic = self._pressed = self.contact = False
        self._free_way -= self.reach
        left, right = self._ground
        # exact integration over the period: both wheels on arcs about a common centre
        turn = (right - left) / self._wheel_base
        half, way = turn / 2, (left + right) / 2
        if not -1e-9 <= half <= 1e-9:
            way *= sin(half) / half
        middle = self.heading + half
        self.x += way * cos(middle)
        self.y += way * sin(middle)
        self.heading += turn
        self.ground_speed = left / CONTROL_PERIOD, right / CONTROL_PERIOD
        return self._ways

    def paint(self, *, visible: bool) -> None:
        """Let cameras see the body, or not; for a shared world, where bodies have looks."""
        colour = [*_HULL_COLOUR, 1.0 if visible else 0.0]
        pybullet.changeVisualShape(self.body, -1, rgbaColor=colour, physicsClientId=self._client)

    def show(self) -> None:
        """Put the rigid body where the robot is: others meet it, and cameras see it there."""
        if not self._dynamic:
            self._sync(*self.ground_speed)

    def drive(self) -> None:
        """Let the wheels' motors pull as was aimed at, in the coming period of the dynamics."""
        if not self._dynamic:
            self._sync(*self.ground_speed)
            self._dynamic = True
        radius = self._model.wheel_radius
        pybullet.setJointMotorControlArray(
            self.body,
            _WHEELS,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[way / (CONTROL_PERIOD * radius) for way in self._ground],
            forces=self._torques(),
            physicsClientId=self._client,
        )

    def arrive(self) -> tuple[float, float]:
        """Take in where the dynamics have brought the body; returns the wheels' ways."""
        self.contact = self._touches()
        (self.x, self.y, _), turn = pybullet.getBasePositionAndOrientation(
            self.body, physicsClientId=self._client
        )
        heading = pybullet.getEulerFromQuaternion(turn)[2]
        self.heading += (heading - self.heading + pi) % (2 * pi) - pi
        (vx, vy, _), (_, _, rate) = pybullet.getBaseVelocity(
            self.body, physicsClientId=self._client
        )
        forward = vx * cos(self.heading) + vy * sin(self.heading)
        half = rate * self._wheel_base / 2
        self.ground_speed = (forward - half, forward + half)
        turned = self._turned()
        return turned[0] / self._scales[0], turned[1] / self._scales[1]

    def _turned(self) -> tuple[float, float]:
        """Ways of the wheels over ground since this was last asked, in metres."""
        states = pybullet.getJointStates(self.body, _WHEELS, physicsClientId=self._client)
        before, self._wheel_angles = self._wheel_angles, (states[0][0], states[1][0])
        radius = self._model.wheel_radius
        left, right = (
            (new - old) * radius for new, old in zip(self._wheel_angles, before, strict=True)
        )
        return left, right

    def _torques(self) -> tuple[float, float]:
        """The most that each motor can do, in N m."""
        # a wheel pulls no harder than its tyre holds: half the weight each, friction 1
        most = self._model.mass * 9.81 / 2 * self._model.wheel_radius
        if not self._pressed:
            return most, most
        # Of two equal robots that push each other, tyres slipping, the solver would let one win at
        # full speed. Motors that stall before, and are weaker the faster they turn, settle it.
        top = self._model.motor.top_speed * PULSE / CONTROL_PERIOD
        left, right = (
            most * _STALL * (1.0 - min(abs(speed) / top, 1.0) * (speed * wanted > 0.0))
            for speed, wanted in zip(self.ground_speed, self._ground, strict=True)
        )
        return left, right

    def _touches(self) -> bool:
        if self._surroundings is None and not self._world.solids:
            return False
        # the hull meets solids, things and other hulls, the floor meets the wheels alone
        points = pybullet.getContactPoints(self.body, linkIndexA=-1, physicsClientId=self._client)
        if self._world.shared:
            robots = {robot.body for robot in self._world.robots}
            self._pressed = any(point[2] in robots for point in points)
        return bool(points)

    def _sync(self, left: float, right: float) -> None:
        """Set the rigid body to the present pose, its wheels turning at given ground speeds."""
        radius = self._model.wheel_radius
        pybullet.resetBasePositionAndOrientation(
            self.body,
            [self.x, self.y, radius],
            pybullet.getQuaternionFromEuler([0.0, 0.0, self.heading]),
            physicsClientId=self._client,
        )
        forward = (left + right) / 2
        pybullet.resetBaseVelocity(
            self.body,
            [forward * cos(self.heading), forward * sin(self.heading), 0.0],
            [0.0, 0.0, (right - left) / self._wheel_base],
            physicsClientId=self._client,
        )
        for wheel, speed in enumerate((left, right)):
            pybullet.resetJointState(
                self.body, wheel, 0.0, speed / radius, physicsClientId=self._client
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
        half_base = self._wheel_base / 2
        caster_height = _CASTER_RADIUS - model.wheel_radius
        if self._world.shared:
            caster_height += _CASTER_LIFT
        places = [
            [0, half_base, 0],
            [0, -half_base, 0],
            [_CASTER_OFFSET, 0, caster_height],
            [-_CASTER_OFFSET, 0, caster_height],
        ]
        body: int = pybullet.createMultiBody(
            baseMass=model.mass * 0.8,
            baseCollisionShapeIndex=hull,
            baseVisualShapeIndex=self._look() if self._world.shared else -1,
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
                (BODY_GROUP, SOLID_GROUP | BODY_GROUP | THING_GROUP)
                if link == -1
                else (FLOOR_GROUP, FLOOR_GROUP)
            )
            pybullet.setCollisionFilterGroupMask(body, link, group, mask, physicsClientId=client)
        hide(body, client, first=0 if self._world.shared else -1)
        return body

    def _look(self) -> int:
        """Shape of the hull and of the camera's mast on it, for the cameras of others."""
        model = self._model
        hull, mast = model.height - _GROUND_CLEARANCE, _MAST_HEIGHT - model.height
        look: int = pybullet.createVisualShapeArray(
            shapeTypes=[pybullet.GEOM_CYLINDER] * 2,
            radii=[model.radius, _MAST_RADIUS],
            lengths=[hull, mast],
            visualFramePositions=[
                [0, 0, _GROUND_CLEARANCE + hull / 2 - model.wheel_radius],
                [0, 0, model.height + mast / 2 - model.wheel_radius],
            ],
            rgbaColors=[[*_HULL_COLOUR, 1.0]] * 2,
            physicsClientId=self._client,
        )
        return look
