"""A robot's rigid body in PyBullet, for what moves when it is pushed: things and other robots.

Two wheels with friction and motors, two frictionless casters, a hull. (Measured: on a free floor
it drives as `chassis` reckons to 0.2 %; see tests/test_chassis.py.)
"""

from math import cos, sin
from typing import NamedTuple

import pybullet
from khepera_protocol.serial.units import CONTROL_PERIOD
from khepera_protocol.zenoh.payloads import Pose

from khepera_emulator.body.hull import GROUND_CLEARANCE, HULL_COLOUR, MAST_HEIGHT, MAST_RADIUS
from khepera_emulator.models import Model
from khepera_emulator.world.dynamics import Dynamics, hide
from khepera_emulator.world.things import BODY_GROUP, FLOOR_GROUP, SOLID_GROUP, THING_GROUP

_CASTER_RADIUS = 0.003
_CASTER_OFFSET = 0.022
_CASTER_LIFT = 0.0002
"""Metres that the casters hang above the floor: on four feet at once it would be the solver's
choice how much of the weight, and so of the grip, the wheels have."""

_WHEELS = (0, 1)

_STALL = 0.75
"""Pull of a stalling motor over what its tyre holds, where robots push each other (a choice)."""


class Arrival(NamedTuple):
    """Motion of a robot in a period of the dynamics.

    Attributes:
        x, y, heading: where it is now; metres, and radians within a turn.
        ground_speed: of left and right wheel, m/s.
        turned: metres that the wheels' treads have turned.
        contact: whether the hull touches anything.
    """

    x: float
    y: float
    heading: float
    ground_speed: tuple[float, float]
    turned: tuple[float, float]
    contact: bool


class RigidBody:
    """The body of one robot in the dynamics of its world.

    Attributes:
        number: of the body in PyBullet.
    """

    def __init__(self, dynamics: Dynamics, model: Model, wheel_base: float) -> None:
        self._dynamics = dynamics
        self._model = model
        self._wheel_base = wheel_base
        self._client = dynamics.client
        self._wheel_angles = (0.0, 0.0)
        self._pressed = False
        self.number = self._build()
        dynamics.robots.add(self.number)

    def place(self, pose: Pose, ground_speed: tuple[float, float]) -> None:
        """Put it somewhere, its wheels rolling at a speed over ground in m/s."""
        radius = self._model.wheel_radius
        left, right = ground_speed
        pybullet.resetBasePositionAndOrientation(
            self.number,
            [pose.x, pose.y, radius],
            pybullet.getQuaternionFromEuler([0.0, 0.0, pose.heading]),
            physicsClientId=self._client,
        )
        forward = (left + right) / 2
        pybullet.resetBaseVelocity(
            self.number,
            [forward * cos(pose.heading), forward * sin(pose.heading), 0.0],
            [0.0, 0.0, (right - left) / self._wheel_base],
            physicsClientId=self._client,
        )
        for wheel, speed in enumerate((left, right)):
            pybullet.resetJointState(
                self.number, wheel, 0.0, speed / radius, physicsClientId=self._client
            )
        self._wheel_angles = (0.0, 0.0)
        self._pressed = False

    def drive(self, ways: tuple[float, float], ground_speed: tuple[float, float]) -> None:
        """Let the motors pull, in the coming period of the dynamics.

        Args:
            ways: metres over ground that the wheels shall go in the period.
            ground_speed: of the wheels now, m/s.
        """
        radius = self._model.wheel_radius
        pybullet.setJointMotorControlArray(
            self.number,
            _WHEELS,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=[way / (CONTROL_PERIOD * radius) for way in ways],
            forces=self._torques(ways, ground_speed),
            physicsClientId=self._client,
        )

    def arrive(self) -> Arrival:
        """Tell where a period of the dynamics has brought it."""
        contact = self._touches()
        (x, y, _), turn = pybullet.getBasePositionAndOrientation(
            self.number, physicsClientId=self._client
        )
        heading: float = pybullet.getEulerFromQuaternion(turn)[2]
        (vx, vy, _), (_, _, rate) = pybullet.getBaseVelocity(
            self.number, physicsClientId=self._client
        )
        forward = vx * cos(heading) + vy * sin(heading)
        half = rate * self._wheel_base / 2
        return Arrival(x, y, heading, (forward - half, forward + half), self._turned(), contact)

    def paint(self, *, visible: bool) -> None:
        """Let cameras see the body, or not; for a shared world, where bodies have looks."""
        colour = [*HULL_COLOUR, 1.0 if visible else 0.0]
        pybullet.changeVisualShape(self.number, -1, rgbaColor=colour, physicsClientId=self._client)

    def _turned(self) -> tuple[float, float]:
        """Return metres that the wheels have turned since this was last asked."""
        states = pybullet.getJointStates(self.number, _WHEELS, physicsClientId=self._client)
        before, self._wheel_angles = self._wheel_angles, (states[0][0], states[1][0])
        radius = self._model.wheel_radius
        left, right = (
            (new - old) * radius for new, old in zip(self._wheel_angles, before, strict=True)
        )
        return left, right

    def _torques(
        self, ways: tuple[float, float], ground_speed: tuple[float, float]
    ) -> tuple[float, float]:
        """Return the most that each motor can do, in N m."""
        # a wheel pulls no harder than its tyre holds: half the weight each, friction 1
        most = self._model.mass * 9.81 / 2 * self._model.wheel_radius
        if not self._pressed:
            return most, most
        # Of two equal robots that push each other, tyres slipping, the solver would let one win at
        # full speed. Motors that stall before, and are weaker the faster they turn, settle it.
        top = self._model.top_speed
        left, right = (
            most * _STALL * (1.0 - min(abs(speed) / top, 1.0) * (speed * wanted > 0.0))
            for speed, wanted in zip(ground_speed, ways, strict=True)
        )
        return left, right

    def _touches(self) -> bool:
        # the hull meets solids, things and other hulls, the floor meets the wheels alone
        points = pybullet.getContactPoints(self.number, linkIndexA=-1, physicsClientId=self._client)
        self._pressed = any(point[2] in self._dynamics.robots for point in points)
        return bool(points)

    def _build(self) -> int:
        body = self._make()
        self._set_dynamics(body)
        hide(body, self._client, first=0 if self._dynamics.shared else -1)
        return body

    def _make(self) -> int:
        """Make the hull with its two wheels and two casters."""
        model = self._model
        radii = (model.wheel_radius, model.wheel_radius, _CASTER_RADIUS, _CASTER_RADIUS)
        half_base = self._wheel_base / 2
        caster_height = _CASTER_RADIUS - model.wheel_radius + _CASTER_LIFT
        places = [
            [0, half_base, 0],
            [0, -half_base, 0],
            [_CASTER_OFFSET, 0, caster_height],
            [-_CASTER_OFFSET, 0, caster_height],
        ]
        body: int = pybullet.createMultiBody(
            baseMass=model.mass * 0.8,
            baseCollisionShapeIndex=self._hull(),
            baseVisualShapeIndex=self._look() if self._dynamics.shared else -1,
            basePosition=[0, 0, model.wheel_radius],
            linkMasses=[model.mass * 0.09, model.mass * 0.09, 0.001, 0.001],
            linkCollisionShapeIndices=[self._sphere(radius) for radius in radii],
            linkVisualShapeIndices=[-1] * 4,
            linkPositions=places,
            linkOrientations=[[0, 0, 0, 1]] * 4,
            linkInertialFramePositions=[[0, 0, 0]] * 4,
            linkInertialFrameOrientations=[[0, 0, 0, 1]] * 4,
            linkParentIndices=[0] * 4,
            linkJointTypes=[pybullet.JOINT_REVOLUTE] * 2 + [pybullet.JOINT_FIXED] * 2,
            linkJointAxis=[[0, 1, 0]] * 4,
            physicsClientId=self._client,
        )
        return body

    def _hull(self) -> int:
        model = self._model
        hull: int = pybullet.createCollisionShape(
            pybullet.GEOM_CYLINDER,
            radius=model.radius,
            height=model.height - GROUND_CLEARANCE,
            # the base frame lies on the wheel axle
            collisionFramePosition=[
                0,
                0,
                (model.height + GROUND_CLEARANCE) / 2 - model.wheel_radius,
            ],
            physicsClientId=self._client,
        )
        return hull

    def _sphere(self, radius: float) -> int:
        shape: int = pybullet.createCollisionShape(
            pybullet.GEOM_SPHERE, radius=radius, physicsClientId=self._client
        )
        return shape

    def _set_dynamics(self, body: int) -> None:
        """Set what slows the body down, how its parts rub, and what they meet."""
        client = self._client
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

    def _look(self) -> int:
        """Make the shape of the hull and of the camera's mast on it, for the cameras of others."""
        model = self._model
        hull, mast = model.height - GROUND_CLEARANCE, MAST_HEIGHT - model.height
        look: int = pybullet.createVisualShapeArray(
            shapeTypes=[pybullet.GEOM_CYLINDER] * 2,
            radii=[model.radius, MAST_RADIUS],
            lengths=[hull, mast],
            visualFramePositions=[
                [0, 0, GROUND_CLEARANCE + hull / 2 - model.wheel_radius],
                [0, 0, model.height + mast / 2 - model.wheel_radius],
            ],
            rgbaColors=[[*HULL_COLOUR, 1.0]] * 2,
            physicsClientId=self._client,
        )
        return look
