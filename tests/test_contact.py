"""Pushing against walls: the body's own impulses against PyBullet's, and what they must obey."""

from math import cos, degrees, hypot, radians, sin
from typing import Any

import numpy as np
import pybullet
import pytest
from as_type import not_none
from khepera_protocol.zenoh.payloads import Pose, WheelDrift
from worlds import arena

from khepera_emulator.body.chassis import Chassis
from khepera_emulator.models import KHEPERA, KHEPERA2, Model
from khepera_emulator.world.world import World

IDEAL = WheelDrift(left_scale=1.0, right_scale=1.0, wheel_base=0.053, slip=0.0)
AHEAD = [{"points": [[0.105, -3.0], [0.105, 3.0]]}]
"""A wall whose face is 0.1 m ahead."""

START = 0.1 - 0.0005 - KHEPERA.radius


def drive(
    walls: list[dict[str, Any]],
    pose: Pose,
    speeds: tuple[float, float],
    periods: int,
    *,
    rigid: bool = False,
    model: Model = KHEPERA,
) -> tuple[np.ndarray, Chassis]:
    """Poses after each period of a robot whose wheels turn at speeds in m/s; and the robot."""
    world = World(arena(wall=walls), rigid=rigid)
    body = Chassis(world, model, IDEAL, pose)
    ways = speeds[0] * 0.01, speeds[1] * 0.01
    places = []
    for _ in range(periods):
        if rigid:
            body.aim(ways, (0.0, 0.0))
            body.drive()
            world.period()
            body.arrive()
        else:
            assert body.roll(ways, (0.0, 0.0)) == ways
        places.append((body.x, body.y, body.heading))
    world.close()
    return np.array(places), body


@pytest.mark.parametrize("angle", [0, 10, 20, 30, 45, 60, 75, 90])
@pytest.mark.parametrize(
    "speeds",
    [(0.04, 0.04), (0.12, 0.12), (0.05, 0.03), (0.03, 0.05), (0.04, 0.0), (-0.04, 0.04)],
    ids=str,
)
def test_a_second_at_a_wall_is_as_in_pybullet(angle: int, speeds: tuple[float, float]) -> None:
    """Return where the body slides and how it turns.

    PyBullet's tyres, once they slip, hold better aside than ahead; so bodies that meet a wall at a
    flat angle turn faster there.
    """
    pose = Pose(x=START, y=0.0, heading=radians(angle))
    own, _ = drive(AHEAD, pose, speeds, 100)
    real, _ = drive(AHEAD, pose, speeds, 100, rigid=True)
    way = max(map(abs, speeds)) * 1.0
    assert np.abs(own[:, 0] - real[:, 0]).max() < 0.0015 + 0.1 * way
    assert np.abs(own[:, 1] - real[:, 1]).max() < 0.001 + 0.35 * way
    assert np.abs(np.degrees(own[:, 2] - real[:, 2])).max() < 15.0 + 300.0 * way
    assert own[:, 0].max() < 0.1 - KHEPERA.radius + 0.0001


def test_over_all_angles_it_is_near_pybullet() -> None:
    ways, turns = [], []
    for angle in range(0, 90, 15):
        for speeds in ((0.04, 0.04), (0.05, 0.03), (0.03, 0.05), (0.04, 0.0)):
            pose = Pose(x=START, y=0.0, heading=radians(angle))
            own, _ = drive(AHEAD, pose, speeds, 100)
            real, _ = drive(AHEAD, pose, speeds, 100, rigid=True)
            ways.append((own[-1, 1] - real[-1, 1]) / max(speeds))
            turns.append(degrees(own[-1, 2] - real[-1, 2]))
    assert np.sqrt(np.mean(np.square(ways))) < 0.12
    assert np.sqrt(np.mean(np.square(turns))) < 12.0


def test_head_on_the_body_stands_and_both_tyres_slip() -> None:
    places, body = drive(AHEAD, Pose(x=0.0, y=0.0, heading=0.0), (0.1, 0.1), 300)
    assert places[-1] == pytest.approx([0.1 - KHEPERA.radius, 0.0, 0.0], abs=1e-6)
    assert body.contact
    assert body.ground_speed == pytest.approx((0.0, 0.0), abs=1e-4)


def test_both_sides_are_alike() -> None:
    pose = Pose(x=START, y=0.0, heading=radians(50))
    mirrored = Pose(x=START, y=0.0, heading=radians(-50))
    left, _ = drive(AHEAD, pose, (0.05, 0.03), 200)
    right, _ = drive(AHEAD, mirrored, (0.03, 0.05), 200)
    # one tyre is asked before the other
    assert left == pytest.approx(right * [1, -1, -1], abs=2e-3)


def test_a_corner_holds_the_body() -> None:
    walls = [{"points": [[-1.0, 0.105], [0.105, 0.105], [0.105, -1.0]]}]
    places, body = drive(walls, Pose(x=0.05, y=0.03, heading=radians(60)), (0.08, 0.08), 500)
    inner = 0.1 - KHEPERA.radius
    assert places[:, :2].max() < inner + 1e-4
    assert places[-1, :2] == pytest.approx([inner, inner], abs=1e-4)
    assert body.contact


@pytest.mark.parametrize("model", [KHEPERA, KHEPERA2])
@pytest.mark.parametrize("speed", [0.02, 0.3, 1.0])
def test_no_speed_drives_into_anything(model: Model, speed: float) -> None:
    parts = {
        "wall": [{"points": [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3]]}],
        "cylinder": [{"centre": [0.1, 0.1], "radius": 0.03}],
    }
    world = World(arena(**parts))
    body = Chassis(world, model, IDEAL, Pose(x=0.29 - model.radius, y=0.0, heading=0.3))
    rng = np.random.default_rng(0)
    touched = 0
    for _ in range(60):
        ways = rng.choice([-0.01, 0.01, 0.01]) * rng.uniform(0.5, 1.0, 2) * speed
        for _ in range(40):
            body.roll(tuple(ways.tolist()), (0.0, 0.0))
            depth = model.radius - world.plan.clearance(body.x, body.y)
            assert depth < 1e-4 + 5e-4 * speed
            touched += body.contact
    world.close()
    assert touched > 50


def test_pushing_never_speeds_the_body_up() -> None:
    for angle in range(0, 91, 10):
        pose = Pose(x=START, y=0.0, heading=radians(angle))
        places, _ = drive(AHEAD, pose, (0.04, 0.04), 150)
        steps = np.diff(places[:, :2], axis=0)
        assert np.hypot(*steps.T).max() <= 0.0004 + 1e-6


def test_contact_ends_when_the_body_leaves() -> None:
    world = World(arena(wall=AHEAD))
    body = Chassis(world, KHEPERA, IDEAL, Pose(x=START, y=0.0, heading=radians(40)))
    for _ in range(50):
        body.roll((0.0004, 0.0004), (0.0, 0.0))
    assert body.contact
    x, y, heading = body.x, body.y, body.heading
    for _ in range(20):
        body.roll((-0.0004, -0.0004), (0.0, 0.0))
    world.close()
    assert not body.contact
    assert hypot(body.x - x, body.y - y) == pytest.approx(0.008, rel=0.05)
    assert body.heading == pytest.approx(heading, abs=0.02)
    assert (body.x - x, body.y - y) == pytest.approx(
        (-0.008 * cos(heading), -0.008 * sin(heading)), abs=5e-4
    )


def test_a_robot_at_a_wall_comes_to_rest() -> None:
    _, body = drive(AHEAD, Pose(x=START, y=0.0, heading=0.3), (0.04, 0.04), 100)
    for _ in range(3):
        body.roll((0.0, 0.0), (0.0, 0.0))
    still = body.x, body.y, body.heading
    assert body.roll((0.0, 0.0), (0.0, 0.0)) == (0.0, 0.0)
    assert (body.x, body.y, body.heading) == pytest.approx(still, abs=1e-7)
    assert body.contact


def test_pybullet_s_walls_meet_the_hull_and_no_wheel() -> None:
    world = World(arena(wall=AHEAD), rigid=True)
    dynamics = not_none(world.dynamics)
    body = Chassis(world, KHEPERA, IDEAL, Pose(x=START, y=0.0, heading=radians(75)))
    number = not_none(body.rigid).number
    links = set()
    for _ in range(60):
        body.aim((0.0004, 0.0004), (0.0, 0.0))
        body.drive()
        world.period()
        body.arrive()
        for solid in dynamics.solids:
            points = pybullet.getContactPoints(number, solid, physicsClientId=dynamics.client)
            links |= {point[3] for point in points}
    world.close()
    # a wheel, a ball in the dynamics, reaches further out than the hull
    assert links == {-1}
