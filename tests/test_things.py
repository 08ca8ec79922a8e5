"""Things that robots push: how they move, who sees them, and that the seed decides it all."""

from collections.abc import Callable, Iterator
from math import degrees, hypot, pi, radians
from pathlib import Path
from typing import Any

import numpy as np
import pybullet
import pytest
from as_type import as_type, not_none
from khepera_protocol.zenoh.payloads import Outline, Pose, Reset, Solid, Truth, WheelDrift
from test_khepera_url import ask, open_port, session
from worlds import arena

from khepera_emulator.body.chassis import Chassis
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import KHEPERA
from khepera_emulator.robot.khepera.robot import Robot
from khepera_emulator.robot.periods import is_moving, run_periods
from khepera_emulator.senses.camera import OmniCamera
from khepera_emulator.world.solids import Brick, Disc
from khepera_emulator.world.things import BODY_GROUP, RAY_GROUP
from khepera_emulator.world.world import World

IDEAL = WheelDrift(left_scale=1.0, right_scale=1.0, wheel_base=0.053, slip=0.0)
ORIGIN = Pose(x=0.0, y=0.0, heading=0.0)
BOX = {"shape": "box", "centre": [0.10, 0.0], "size": [0.04, 0.04], "mass": 0.02}
POST = {"shape": "post", "centre": [0.10, 0.0], "radius": 0.0125, "mass": 0.02}
BALL = {"shape": "ball", "centre": [0.10, 0.0], "radius": 0.02, "mass": 0.005}
HALF = {"box": 0.02, "post": 0.0125, "ball": 0.02}


def client_of(world: World) -> int:
    return not_none(world.dynamics).client


class Bench:
    """A robot among things, driven without a serial line."""

    def __init__(self, *things: dict[str, Any], pose: Pose = ORIGIN, **parts: Any) -> None:
        self.world = World(arena(object=list(things), **parts))
        self.robot = Robot(self.world, KHEPERA, pose, IDEAL, np.random.default_rng(0))

    def drive(self, speed: int, seconds: float) -> None:
        for wheel in self.robot.wheels:
            wheel.drive_speed(speed)
        self.run(self.robot.ticks + round(seconds * 100))

    def run(self, ticks: int) -> None:
        run_periods(self.world, [self.robot], ticks)

    @property
    def moving(self) -> bool:
        return is_moving(self.world, [self.robot])

    @property
    def things(self) -> list[Brick | Disc]:
        return [thing.footprint for thing in self.world.things]


@pytest.fixture
def bench() -> Iterator[Callable[..., Bench]]:
    made = []

    def make(*things: dict[str, Any], **parts: Any) -> Bench:
        made.append(Bench(*things, **parts))
        return made[-1]

    yield make
    for each in made:
        each.world.close()


@pytest.mark.parametrize("thing", [BOX, POST, BALL], ids=lambda thing: thing["shape"])
class TestPushing:
    def test_moves_a_thing_ahead_of_the_robot(
        self, bench: Callable[..., Bench], thing: dict[str, Any]
    ) -> None:
        made = bench(thing)
        made.drive(5, 4.0)
        body, (place,) = made.robot.chassis, made.things
        assert body.x == pytest.approx(0.16, abs=0.004)
        gap = place.x - body.x - KHEPERA.radius - HALF[thing["shape"]]
        # a ball is knocked on, the others are pushed all the way
        assert -0.0005 < gap < (0.03 if thing["shape"] == "ball" else 0.0015)
        assert abs(place.y) < 0.002
        assert made.robot.touched

    def test_ends_when_the_robot_stops(
        self, bench: Callable[..., Bench], thing: dict[str, Any]
    ) -> None:
        made = bench(thing)
        made.drive(10, 1.3)
        made.drive(0, 3.0)
        place = (made.things[0].x, made.things[0].y)
        assert place[0] > 0.105
        assert not made.world.restless
        made.drive(0, 1.0)
        assert (made.things[0].x, made.things[0].y) == pytest.approx(place, abs=1e-6)

    def test_leaves_it_upright_on_the_floor(
        self, bench: Callable[..., Bench], thing: dict[str, Any]
    ) -> None:
        made = bench(thing, pose=Pose(x=0.0, y=0.012, heading=0.0))
        made.drive(15, 1.5)
        (body,) = made.world.things
        (_, _, z), turn = pybullet.getBasePositionAndOrientation(
            body.body, physicsClientId=client_of(made.world)
        )
        rise = thing.get("radius", 0.02) if thing["shape"] == "ball" else 0.02
        assert z == pytest.approx(rise, abs=0.0005)
        assert pybullet.getEulerFromQuaternion(turn)[:2] == pytest.approx((0.0, 0.0), abs=0.01)

    def test_stops_at_a_wall_and_so_does_the_robot(
        self, bench: Callable[..., Bench], thing: dict[str, Any]
    ) -> None:
        made = bench(thing, wall=[{"points": [[0.205, -1.0], [0.205, 1.0]]}])
        made.drive(10, 4.0)
        (place,) = made.things
        assert place.x == pytest.approx(0.2 - HALF[thing["shape"]], abs=0.001)
        gap = place.x - made.robot.chassis.x - HALF[thing["shape"]]
        assert gap == pytest.approx(KHEPERA.radius, abs=0.001)

    def test_nothing_moves_before_it_is_touched(
        self, bench: Callable[..., Bench], thing: dict[str, Any]
    ) -> None:
        made = bench(thing)
        made.drive(5, 0.8)
        assert not made.robot.touched
        assert (made.things[0].x, made.things[0].y) == tuple(thing["centre"])


def test_a_ball_rolls_on_and_a_box_does_not(bench: Callable[..., Bench]) -> None:
    ways = []
    for thing in (BALL, BOX):
        made = bench(thing)
        made.drive(20, 0.7)
        at = made.things[0].x
        made.drive(0, 4.0)
        ways.append(made.things[0].x - at)
    # 0.16 m/s against mu g: 3 mm of sliding, and twenty times that of rolling, less the push
    assert ways[0] > 0.03 > 0.015 > ways[1]


def test_a_box_pushed_at_its_edge_turns(bench: Callable[..., Bench]) -> None:
    made = bench(BOX, pose=Pose(x=0.0, y=0.018, heading=0.0))
    made.drive(5, 4.0)
    assert degrees(as_type(Brick, made.things[0]).heading) < -10


def test_a_heavy_thing_holds_a_robot(bench: Callable[..., Bench]) -> None:
    made = bench({**BOX, "mass": 3.0})
    made.drive(10, 3.0)
    assert made.things[0].x < 0.103
    assert made.robot.chassis.x < 0.055


@pytest.mark.parametrize(
    "parts", [{"object": [{**BOX, "mass": 3.0}]}, {"wall": [{"points": [[0.1, -1], [0.1, 1]]}]}]
)
def test_a_robot_that_has_stopped_at_something_rests(
    parts: dict[str, list[dict[str, list[list[float]] | object]]],
) -> None:
    world = World(arena(**parts))
    robot = Robot(world, KHEPERA, ORIGIN, IDEAL, np.random.default_rng(0))
    for speed, ticks in ((10, 150), (0, 250)):
        for wheel in robot.wheels:
            wheel.drive_speed(speed)
        run_periods(world, [robot], ticks)
    gap = robot.chassis.scene.clearance(robot.chassis.x, robot.chassis.y) - KHEPERA.radius
    assert abs(gap) < 0.0005
    assert not is_moving(world, [robot])
    pose = robot.chassis.pose
    run_periods(world, [robot], 1000)
    assert robot.chassis.pose == pose
    world.close()


def test_a_thing_pushes_the_next(bench: Callable[..., Bench]) -> None:
    made = bench(POST, {**BALL, "centre": [0.16, 0.0]})
    made.drive(10, 2.0)
    post, ball = made.things
    assert post.x > 0.14
    assert ball.x > post.x + 0.0125 + 0.02 - 0.001


def test_a_robot_in_the_open_drives_as_exactly_as_without_things(
    bench: Callable[..., Bench],
) -> None:
    alone, among = bench(), bench({**BALL, "centre": [0.5, 0.5]})
    for made in (alone, among):
        made.robot.wheels[0].drive_speed(7)
        made.robot.wheels[1].drive_speed(9)
        made.run(300)
    assert among.robot.chassis.pose == alone.robot.chassis.pose
    assert among.robot.wheels[0].counter == alone.robot.wheels[0].counter


def test_a_robot_in_the_open_drives_exactly_while_something_rolls(
    bench: Callable[..., Bench],
) -> None:
    made, alone = bench(BALL), bench()
    (ball,) = made.world.things
    pybullet.resetBaseVelocity(ball.body, [0.3, 0.1, 0], physicsClientId=client_of(made.world))
    made.world.period()
    assert made.world.restless
    for each in (made, alone):
        each.robot.wheels[0].drive_speed(-5)
        each.robot.wheels[1].drive_speed(-7)
        each.run(50)
    assert made.things[0].x > 0.15
    assert made.robot.chassis.pose == alone.robot.chassis.pose


def test_time_passes_for_a_rolling_ball_while_the_robot_rests(bench: Callable[..., Bench]) -> None:
    made = bench(BALL)
    (ball,) = made.world.things
    pybullet.resetBaseVelocity(ball.body, [0.2, 0, 0], physicsClientId=client_of(made.world))
    made.world.period()
    made.run(300)
    # v^2 / 2a with a = 0.05 x 0.4 g
    assert made.things[0].x - 0.1 == pytest.approx(0.04 / (2 * 0.05 * 0.4 * 9.81), rel=0.1)
    assert not made.moving


def test_rays_equal_those_of_pybullet() -> None:
    parts = {
        "wall": [{"points": [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5]]}],
        "object": [
            {**BOX, "centre": [0.2, 0.1], "heading": 30, "size": [0.1, 0.04]},
            {**POST, "centre": [-0.2, 0.2], "radius": 0.03},
            {**BALL, "centre": [0.1, -0.3], "radius": 0.02},
        ],
    }
    world = World(arena(**parts), shared=True)
    for x in (-0.3, 0.3):
        robot = Chassis(world, KHEPERA, IDEAL, Pose(x=x, y=-0.2, heading=0.0))
        # rays pass through a robot otherwise
        pybullet.setCollisionFilterGroupMask(
            not_none(robot.rigid).number,
            -1,
            BODY_GROUP,
            RAY_GROUP,
            physicsClientId=client_of(world),
        )
    scene = world.scene()
    rng = np.random.default_rng(0)
    places = rng.uniform(-0.7, 0.7, (3000, 2))
    places = places[[scene.clearance(x, y) > 1e-3 for x, y in places]]
    angles = rng.uniform(-pi, pi, len(places))
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    height = np.full(len(places), 0.02)
    expected = 2.0 * not_none(world.dynamics).cast(
        np.column_stack([places, height]), np.column_stack([places + 2.0 * rays, height])
    )
    distances, grey = scene.cast(places, rays)
    world.close()
    assert np.mean(np.abs(np.minimum(distances, 2.0) - expected) > 1.5e-3) < 0.01
    assert np.mean(expected < 2.0) > 0.3
    assert np.mean(grey == 120 / 255) > 0.02


def test_clearance_is_the_distance_that_a_ray_finds() -> None:
    world = World(arena(object=[{**BOX, "heading": 40, "size": [0.1, 0.03]}, POST]))
    scene = world.scene()
    world.close()
    angles = np.linspace(-pi, pi, 720)
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for x, y in np.random.default_rng(1).uniform(-0.2, 0.3, (100, 2)):
        clearance = scene.clearance(x, y)
        if clearance > 0.005:
            distances, _ = scene.cast(np.tile([x, y], (720, 1)), rays)
            assert clearance - 1e-9 <= distances.min() <= clearance + 1.2e-3


def test_proximity_sees_a_thing_where_it_is_now(bench: Callable[..., Bench]) -> None:
    white, black = (
        bench({**BOX, "centre": [0.065, 0.0], "colour": [shade] * 3}) for shade in (1.0, 0.0)
    )
    empty = bench()
    readings = [max(made.robot.proximity()[2:4]) for made in (white, black, empty)]
    assert readings[0] > 700
    assert readings[0] > readings[1] + 100
    assert readings[2] < 50
    white.drive(-10, 1.0)
    assert max(white.robot.proximity()) < 50


def test_a_thing_throws_a_shadow_and_a_lamp_is_seen(bench: Callable[..., Bench]) -> None:
    lamp = [{"centre": [0.3, 0.0]}]
    free, shaded = bench(lamp=lamp), bench(BOX, lamp=lamp)
    assert max(free.robot.ambient()[2:4]) < 420
    assert min(shaded.robot.ambient()[2:4]) > 470
    pictures = []
    for made in bench(), free:
        camera = OmniCamera(made.world, np.random.default_rng(0), noise=0.0)
        pictures.append(camera.panorama(ORIGIN))
    changed = np.argwhere((pictures[0] != pictures[1]).any(axis=2))
    assert 0 < len(changed) < 60
    assert abs(changed.mean(axis=0)[1] - 119.5) < 3


def test_the_camera_sees_a_thing_where_it_is_now(bench: Callable[..., Bench]) -> None:
    made = bench({**BOX, "colour": [1, 0, 0]})
    camera = OmniCamera(made.world, np.random.default_rng(0), noise=0.0)

    def red(pose: Pose) -> tuple[int, Any]:
        picture = camera.panorama(pose).astype(int)
        where = np.argwhere((picture[:, :, 2] > 100) & (picture[:, :, 1] < 30))
        return len(where), where[:, 1].mean() if len(where) else None

    count, column = red(ORIGIN)
    assert count > 20
    assert column == pytest.approx(119.5, abs=1)
    made.drive(10, 2.5)
    assert red(Pose(x=made.things[0].x, y=-0.08, heading=0.0))[1] == pytest.approx(59.5, abs=2)


THINGS = """
version = 1
title = "Things"
start = { x = 0.0, y = 0.0 }
free = { points = [[-0.15, 0.0], [0.15, 0.0]], half_width = 0.1 }
[[wall]]
points = [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3]]
[[object]]
shape = "box"
centre = [0.06, 0.0]
size = [0.04, 0.04]
[[object]]
shape = "ball"
centre = [-0.10, 0.05]
radius = 0.02
mass = 0.005
"""


@pytest.fixture
def url(tmp_path: Path) -> str:
    path = tmp_path / "things.toml"
    path.write_text(THINGS)
    return f"khepera://{path}?seed=7"


def test_a_seeded_reset_puts_everything_back(url: str) -> None:
    with open_port(url) as fresh:
        expected = session(fresh)
        # pushed about: the session is one with contacts
        assert fresh.emulator.outline().solids[-2:] != open_outline(url)
    with open_port(url) as used:
        ask(used, b"D,15,14")
        used.timeout = 1.5
        used.read(1)
        assert session(used, Reset(seed=7)) == expected


def open_outline(url: str) -> list[Solid]:
    with open_port(url) as port:
        outline: Outline = port.emulator.outline()
        return outline.solids[-2:]


def test_how_time_is_cut_makes_no_difference(url: str) -> None:
    def drive(steps: int) -> tuple[bytes, Truth, Outline]:
        with open_port(url) as port:
            port.write(b"D,10,9\nN\nH\n")
            for step in range(steps):
                port.emulator.advance(port.now + (2.5 - port.now) / (steps - step))
            return port.emulator.read(), port.emulator.truth(), port.emulator.outline()

    assert drive(1) == drive(7) == drive(997)


def test_random_places_and_resets_keep_off_things(url: str) -> None:
    with open_port(url) as port:
        reset = port.emulator.reset
        ask(port, b"D,10,10")
        port.timeout = 1.5
        port.read(1)
        (box, ball) = port.emulator._fleet.world.things
        assert box.footprint.x > 0.1
        # where the box was at first, there is room now
        assert reset(Reset(pose=Pose(x=0.06, y=0.0, heading=0.0))).pose.x == 0.06
        for number in range(30):
            pose = reset(Reset(random=True)).pose
            places = [(each.footprint.x, each.footprint.y) for each in (box, ball)]
            assert min(hypot(pose.x - x, pose.y - y) for x, y in places) > 0.0275 + 0.02 + 0.03
            if number == 0:
                before = port.emulator.truth()
                with pytest.raises(EmulatorError, match="no room"):
                    reset(Reset(pose=Pose(x=places[0][0], y=places[0][1], heading=0.0)))
                assert port.emulator.truth() == before
        with pytest.raises(EmulatorError, match="no room"):
            reset(Reset(pose=Pose(x=0.06, y=0.0, heading=radians(5)), seed=1))
