"""The body: exact kinematics in the open, the same in PyBullet, contacts at walls, and no seam."""

from collections.abc import Iterator
from math import degrees, pi, radians

import numpy as np
import pytest
from khepera_protocol.zenoh.payloads import Pose, WheelDrift

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.body.chassis import Chassis
from khepera_emulator.models import KHEPERA, KHEPERA2, KheperaModel
from khepera_emulator.robot.khepera.robot import Robot
from khepera_emulator.world.world import World

NO_DRIFT = WheelDrift(left_scale=1.0, right_scale=1.0, wheel_base=0.053, slip=0.0)

IDEAL = WheelDrift(left_scale=1.0, right_scale=1.0, wheel_base=0.053, slip=0.0)
STRAIGHT = (0.0004, 0.0004)
NO_SLIP = (0.0, 0.0)


@pytest.fixture
def world(request: pytest.FixtureRequest) -> Iterator[World]:
    walls = getattr(request, "param", [])
    arena = {
        "version": 1,
        "title": "test",
        "start": {"x": 0, "y": 0},
        "free": {"points": [[0, 0], [0.1, 0]], "half_width": 0.1},
        "wall": [{"points": points} for points in walls],
    }
    made = World(Arena.model_validate(arena), rigid=True)
    yield made
    made.close()


AHEAD = pytest.mark.parametrize("world", [[[[0.105, -1.0], [0.105, 1.0]]]], indirect=True)
BESIDE = pytest.mark.parametrize("world", [[[[-1.0, 0.105], [2.0, 0.105]]]], indirect=True)


def chassis(world: World, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> Chassis:
    return Chassis(world, KHEPERA, IDEAL, Pose(x=x, y=y, heading=heading))


def roll(
    driven: Chassis, world: World, ways: tuple[float, float], dynamics: bool
) -> tuple[float, float]:
    """A control period, by PyBullet or without it; the ways that the wheels turned."""
    if not dynamics:
        return driven.roll(ways, NO_SLIP)
    driven.aim(ways, NO_SLIP)
    driven.drive()
    world.period()
    return driven.arrive()


@pytest.mark.parametrize("dynamics", [False, True])
def test_a_straight_drive(world: World, dynamics: bool) -> None:
    driven = chassis(world)
    turned = np.sum([roll(driven, world, STRAIGHT, dynamics) for _ in range(1000)], axis=0)
    assert driven.x == pytest.approx(0.4, rel=0.005)
    assert driven.y == pytest.approx(0.0, abs=0.001)
    assert degrees(driven.heading) == pytest.approx(0.0, abs=0.3)
    assert turned == pytest.approx([0.4, 0.4], rel=0.005)


@pytest.mark.parametrize("dynamics", [False, True])
def test_a_turn_on_the_spot(world: World, dynamics: bool) -> None:
    driven = chassis(world)
    for _ in range(500):
        roll(driven, world, (-0.0004, 0.0004), dynamics)
    assert degrees(driven.heading) == pytest.approx(432.4, abs=1.0)
    assert (driven.x, driven.y) == pytest.approx((0.0, 0.0), abs=0.001)


def test_an_arc_is_the_same_in_both(world: World) -> None:
    free, rigid = chassis(world), chassis(world, 1.0)
    for _ in range(300):
        free.roll((0.0003, 0.0005), NO_SLIP)
        roll(rigid, world, (0.0003, 0.0005), dynamics=True)
    assert rigid.x - 1.0 == pytest.approx(free.x, abs=0.0012)
    assert rigid.y == pytest.approx(free.y, abs=0.0012)
    assert rigid.heading == pytest.approx(free.heading, rel=0.01)


@AHEAD
def test_a_wall_stops_the_body_and_the_wheels_slip(world: World) -> None:
    driven = chassis(world)
    turned = np.sum([driven.roll(STRAIGHT, NO_SLIP) for _ in range(400)], axis=0)
    assert driven.contact
    assert 0.100 - driven.x == pytest.approx(KHEPERA.radius, abs=0.0005)
    assert abs(driven.heading) < radians(2)
    # 0.16 m are wanted, 0.0725 m are free: full drive slips on the floor
    assert turned.mean() == pytest.approx(0.16, rel=0.02)


@AHEAD
def test_nothing_is_touched_short_of_the_wall(world: World) -> None:
    driven = chassis(world, x=0.100 - KHEPERA.radius - 0.0015)
    driven.roll((0.0, 0.0), NO_SLIP)
    driven.roll((1e-5, 1e-5), NO_SLIP)
    assert not driven.contact


@AHEAD
def test_a_robot_backs_off_from_a_wall(world: World) -> None:
    driven = chassis(world, x=0.07)
    for _ in range(50):
        driven.roll(STRAIGHT, NO_SLIP)
    for _ in range(100):
        driven.roll((-0.0004, -0.0004), NO_SLIP)
    assert not driven.contact
    assert driven.x == pytest.approx(0.100 - KHEPERA.radius - 0.04, abs=0.001)
    assert degrees(driven.heading) == pytest.approx(0.0, abs=1.5)


@AHEAD
def test_contact_ends_with_the_first_millimetre(world: World) -> None:
    driven = chassis(world, x=0.07)
    for _ in range(50):
        driven.roll(STRAIGHT, NO_SLIP)
    assert driven.contact
    for _ in range(10):
        driven.roll((-0.0001, -0.0001), NO_SLIP)
    assert 0.0005 < 0.100 - KHEPERA.radius - driven.x < 0.0015
    assert not driven.contact


@BESIDE
def test_a_robot_that_meets_a_wall_aslant_slides_along_it(world: World) -> None:
    driven = chassis(world, heading=radians(20))
    places = []
    for _ in range(600):
        driven.roll(STRAIGHT, NO_SLIP)
        places.append((driven.x, driven.y))
    x, y = np.array(places).T
    assert y.max() <= 0.100 - KHEPERA.radius + 0.0005
    touch = int(np.argmax(y > 0.100 - KHEPERA.radius - 0.0005))
    # wheels hardly slip sideways: it goes on along the wall a little, and friction turns its nose
    assert 0.004 < x[-1] - x[touch] < 0.04
    assert all(np.diff(x[touch:]) > -0.0002)
    assert degrees(driven.heading) > 22


@AHEAD
def test_the_way_from_kinematics_to_dynamics_has_no_jump(world: World) -> None:
    driven = chassis(world)
    steps = []
    for _ in range(170):
        before = driven.x
        driven.roll(STRAIGHT, NO_SLIP)
        steps.append(driven.x - before)
    assert steps == pytest.approx([0.0004] * 170, rel=0.03)


@AHEAD
def test_a_large_slip_never_turns_a_wheel_round(world: World) -> None:
    driven = chassis(world, x=0.071)
    for slip in (-5.0, -1.0, -0.99, 3.0):
        turned = driven.roll(STRAIGHT, (slip, slip))
        assert min(turned) >= -1e-4
        assert max(turned) <= 0.001


def test_placing_forgets_the_past(world: World) -> None:
    driven = chassis(world)
    for _ in range(10):
        driven.roll((0.001, 0.0005), NO_SLIP)
    driven.place(Pose(x=0.5, y=-0.5, heading=pi / 2))
    assert driven.ground_speed == (0.0, 0.0)
    for _ in range(100):
        driven.roll(STRAIGHT, NO_SLIP)
    assert (driven.x, driven.y) == pytest.approx((0.5, -0.46))


def test_heading_of_the_pose_lies_in_one_turn(world: World) -> None:
    driven = chassis(world, heading=3.0)
    for _ in range(1000):
        driven.roll((-0.0004, 0.0004), NO_SLIP)
        assert -pi <= driven.pose.heading < pi


@AHEAD
@pytest.mark.parametrize("model", [KHEPERA, KHEPERA2])
def test_truth_tells_of_contacts(world: World, model: KheperaModel) -> None:
    pose = Pose(x=0.0, y=0.0, heading=0.0)
    robot = Robot(world, model, pose, NO_DRIFT, np.random.default_rng(0))
    assert not robot.truth().contact
    for wheel in robot.wheels:
        wheel.drive_speed(10)
    for _ in range(150):
        robot.tick()
    assert robot.truth().contact
    assert robot.truth().touched
    # encoders count on while the wheels slip
    assert robot.wheels[0].counter > 1300
    robot.put_down(pose)
    assert not robot.truth().contact
    assert not robot.truth().touched
    assert robot.truth().speed == (0.0, 0.0)


def test_truth_of_a_robot_at_rest_has_no_speed(world: World) -> None:
    pose = Pose(x=0.0, y=0.0, heading=0.0)
    robot = Robot(world, KHEPERA, pose, NO_DRIFT, np.random.default_rng(0))
    for wheel in robot.wheels:
        wheel.drive_speed(10)
    for _ in range(100):
        robot.tick()
    assert robot.truth().speed == pytest.approx((0.08, 0.08), rel=0.05)
    robot.power_on()
    robot.tick()
    assert robot.truth().speed == (0.0, 0.0)
