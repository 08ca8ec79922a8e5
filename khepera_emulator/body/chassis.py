"""A robot's body on its wheels: exact kinematics in the open, friction where it pushes walls.

Away from everything else nothing but the wheels acts on the body, and the pose follows from the
ways of the two wheels exactly. In a period whose way would lead into a wall, tyres slip and the
body slides: `contact`. As soon as the body could touch something that moves when it is pushed, the
same wheels drive a rigid body in PyBullet instead: `rigid_body`. `periods` then brings all robots
through a period together. (In a world of rigid bodies they drive that one all the time.)
"""

from math import cos, pi, sin
from typing import TYPE_CHECKING

from khepera_protocol.serial.units import CONTROL_PERIOD
from khepera_protocol.zenoh.payloads import Pose, WheelDrift

from khepera_emulator.body.contact import Contact, Motion, Touch
from khepera_emulator.body.hull import robot_look
from khepera_emulator.models import Model
from khepera_emulator.world.floor_plan import NEAR, Surroundings
from khepera_emulator.world.looks import Look
from khepera_emulator.world.solids import Disc, Solid
from khepera_emulator.world.world import World

if TYPE_CHECKING:
    from khepera_emulator.body.rigid_body import RigidBody

_CLOSE = 1e-4
"""Gap in metres below which the body counts as touching."""

_MOVER_MARGIN = 0.002
"""Gap in metres to things and robots below which PyBullet takes over, on top of what the next
period can bring."""

_LEAST_GRIP = 0.2
"""Least part of a wheel's way that reaches the ground, however large the slip that was drawn."""

_STILL = 1e-6
"""Metres a period below which a wheel that hardly shall turn stands: the dynamics never rest."""

_GREY = 120 / 255
"""Brightness of a robot to infrared (KiKS)."""


class Chassis(Disc):
    """The body of one robot: a disc from above.

    Attributes:
        pose: where it stands.
        contact: whether it touched something in the last period.
        ground_speed: of left and right wheel over the floor, m/s.
        reach: metres that it can go in the coming period.
        scene: what there is for it to see and to touch.
        rigid: its rigid body; None in a world without dynamics.
    """

    def __init__(self, world: World, model: Model, drift: WheelDrift, pose: Pose) -> None:
        super().__init__(pose.x, pose.y, model.radius, _GREY)
        self._model = model
        self._plan = world.plan
        self._world = world
        self.left_scale, self.right_scale = drift.left_scale, drift.right_scale
        self.wheel_base = drift.wheel_base
        self.scene = world.scene(self)
        # None in a world where nothing else moves: nothing to look out for
        self._surroundings = self.scene if isinstance(self.scene, Surroundings) else None
        self.pushing = Contact(model, drift.wheel_base)
        self.rigid = _rigid_body(world, model, drift.wheel_base)
        if world.shared:
            world.movers.append(self)
            world.robots.append(self)
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
        self.reach = 0.0
        self._dynamic = False
        self.sliding: Motion | None = None
        self.free_way = self._apart = 0.0
        self._world.arrangement += 1
        self._arrangement = -1
        self.pushing.forget()
        self.show()

    def roll(self, ways: tuple[float, float], slip: tuple[float, float]) -> tuple[float, float]:
        """Turn the wheels for one control period in a world where nothing else moves.

        Args:
            ways: counted way that the motors give the two wheels, in metres.
            slip: relative error of each wheel's way over ground in this period.

        Returns:
            The ways that the wheels really turned.
        """
        self.aim(ways, slip)
        return self.go()

    def aim(self, ways: tuple[float, float], slip: tuple[float, float]) -> None:
        """Say what the wheels shall do in the next control period; see `roll`.

        Then `go`, or `drive`, `World.period` and `arrive`.
        """
        grip_left, grip_right = 1.0 + slip[0], 1.0 + slip[1]
        left = self.left_scale * (grip_left if grip_left > _LEAST_GRIP else _LEAST_GRIP)
        right = self.right_scale * (grip_right if grip_right > _LEAST_GRIP else _LEAST_GRIP)
        self._ways = ways
        self._scales = left, right
        self._ground = ground_left, ground_right = ways[0] * left, ways[1] * right
        reach_left, reach_right = abs(ground_left), abs(ground_right)
        self.reach = reach_left if reach_left > reach_right else reach_right

    def meets_mover(self, most: float) -> bool:
        """Tell whether the body could touch what moves in the period; all must have aimed.

        Args:
            most: metres that anything in the world may go in the period.
        """
        if self._world.rigid:
            return True
        if self._surroundings is None:
            return False
        arrangement = self._world.arrangement
        self._apart -= 2 * most
        if self._apart > _MOVER_MARGIN and self._arrangement == arrangement:
            return False
        reach = self.radius + self.reach + _MOVER_MARGIN
        nearest, meets = NEAR, False
        for mover in self._surroundings.around(self.x, self.y):
            gap = mover.gap(self.x, self.y)
            meets = meets or gap < reach + mover.reach
            nearest = min(nearest, gap)
        # need not be asked again before body and movers can have come so much nearer
        self._apart = nearest - self.radius - 2 * most
        self._arrangement = arrangement
        return meets

    def go(self) -> tuple[float, float]:
        """Go the way that was aimed at, as far as walls allow; returns the wheels' ways."""
        limit = self.reach + _CLOSE
        if self.free_way < limit or self.sliding is not None:
            near = self._plan.near(self.x, self.y, self.radius + limit)
            if near or self.sliding is not None:
                self._go_along(near)
                return self._ways
            self.free_way = self._plan.clearance(self.x, self.y) - self.radius
        self.free_way -= self.reach
        self.contact = False
        self._glide()
        return self._ways

    def show(self) -> None:
        """Put the rigid body where the robot is: others meet it there."""
        if not self._dynamic and self.rigid is not None:
            self.rigid.place(self.pose, self.ground_speed)

    def looks(self) -> list[Look]:
        """Return what others see of it, where it is."""
        return robot_look(self._model, self.x, self.y)

    def drive(self) -> None:
        """Let the wheels' motors pull as was aimed at, in the coming period of the dynamics."""
        if not self._dynamic:
            self.show()
            self._dynamic = True
            self.sliding = None
            self.pushing.forget()
        assert self.rigid is not None
        self.rigid.drive(self._ground, self.ground_speed)

    def arrive(self) -> tuple[float, float]:
        """Take in where the dynamics have brought the body; returns the wheels' ways."""
        assert self.rigid is not None
        arrival = self.rigid.arrive()
        self.x, self.y, self.contact = arrival.x, arrival.y, arrival.contact
        self.heading += (arrival.heading - self.heading + pi) % (2 * pi) - pi
        self.ground_speed = arrival.ground_speed
        self.free_way = 0.0  # who knows where it was pushed
        left, right = (
            0.0 if abs(turned) < _STILL and abs(wanted) < _STILL else turned / scale
            for turned, wanted, scale in zip(arrival.turned, self._ways, self._scales, strict=True)
        )
        return left, right

    def _glide(self) -> None:
        """Go the way that was aimed at, as nothing is in it."""
        self._dynamic = False
        left, right = self._ground
        # exact integration over the period: both wheels on arcs about a common centre
        turn = (right - left) / self.wheel_base
        half, way = turn / 2, (left + right) / 2
        if not -1e-9 <= half <= 1e-9:
            way *= sin(half) / half
        middle = self.heading + half
        self.x += way * cos(middle)
        self.y += way * sin(middle)
        self.heading += turn
        self.ground_speed = left / CONTROL_PERIOD, right / CONTROL_PERIOD

    def _go_along(self, near: list[Solid]) -> None:
        """Go close to solids, or until the tyres have stopped slipping: glide, or push."""
        self._dynamic = False
        self.free_way = 0.0
        left, right = self._ground
        sliding = self.sliding
        turn = (right - left) / self.wheel_base
        # the direction in the middle of the period
        middle = self.heading + (turn if sliding is None else sliding.rate * CONTROL_PERIOD) / 2
        c, s, way = cos(middle), sin(middle), (left + right) / 2
        touches = []
        gap = _CLOSE
        for solid in near:
            distance, nx, ny = solid.toward(self.x, self.y)
            touch = Touch(distance - self.radius, c * nx + s * ny, c * ny - s * nx)
            touches.append(touch)
            # solids are convex: what is left of the gap if nothing stops the body, at least
            gap = min(gap, touch.gap - way * touch.ahead)
        if sliding is None:
            if gap > 0.0 or not touches:
                self.contact = gap < _CLOSE
                self._glide()
                return
            before_left, before_right = self.ground_speed
            rate = (before_right - before_left) / self.wheel_base
            sliding = Motion((before_left + before_right) / 2, 0.0, rate)
        wheels = left / CONTROL_PERIOD, right / CONTROL_PERIOD
        motion = self.pushing.push(sliding, wheels, touches)
        ahead, aside, rate = motion
        self.x += (c * ahead - s * aside) * CONTROL_PERIOD
        self.y += (s * ahead + c * aside) * CONTROL_PERIOD
        self.heading += rate * CONTROL_PERIOD
        half = rate * self.wheel_base / 2
        self.ground_speed = ahead - half, ahead + half
        self.contact = self.pushing.pressing or gap < _CLOSE
        self.sliding = motion
        if not (self.pushing.pressing or self.pushing.slipping):
            self.sliding = None
            self.pushing.forget()


def _rigid_body(world: World, model: Model, wheel_base: float) -> "RigidBody | None":
    if world.dynamics is None:
        return None
    from khepera_emulator.body.rigid_body import RigidBody

    return RigidBody(world.dynamics, model, wheel_base)
