"""The camera: left is left, turning the robot turns the picture, and noise is seeded."""

from collections.abc import Callable, Iterator
from importlib import resources
from math import pi
from typing import Any

import numpy as np
import pybullet
import pytest
from as_type import not_none
from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.payloads import Pose, WheelDrift
from worlds import arena

from khepera_emulator.arenas.arena import Arena, load_arena
from khepera_emulator.body.chassis import Chassis
from khepera_emulator.models import KHEPERA
from khepera_emulator.senses.camera import HEIGHT, OmniCamera
from khepera_emulator.senses.renderers.faces import FacesRenderer
from khepera_emulator.senses.renderers.layered import LayeredRenderer
from khepera_emulator.world.world import World

RED, GREEN, BLUE, YELLOW = (2,), (1,), (0,), (1, 2)
MIRROR = Mirror()
IDEAL = WheelDrift(left_scale=1.0, right_scale=1.0, wheel_base=0.053, slip=0.0)


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    sides = {
        "red": ([[0.3, -0.3], [0.3, 0.3]], [1, 0, 0]),
        "green": ([[-0.3, 0.3], [0.3, 0.3]], [0, 1, 0]),
        "blue": ([[-0.3, -0.3], [-0.3, 0.3]], [0, 0, 1]),
        "yellow": ([[-0.3, -0.3], [0.3, -0.3]], [1, 1, 0]),
    }
    made = World(
        Arena.model_validate(
            {
                "version": 1,
                "title": "four colours",
                "floor": [0.4, 0.2, 0.1],
                "sky": [0.5, 0.7, 0.9],
                "start": {"x": 0, "y": 0},
                "free": {"points": [[0, 0], [0.1, 0]], "half_width": 0.1},
                "wall": [
                    {"points": points, "colour": colour, "thickness": 0.02}
                    for points, colour in sides.values()
                ],
            }
        ),
        rigid=True,
    )
    yield made
    made.close()


def faces(world: World, resolution: int = 64) -> FacesRenderer:
    return FacesRenderer(world, HEIGHT, MIRROR.low, MIRROR.high, resolution)


def layered(world: World) -> LayeredRenderer:
    return LayeredRenderer(world, HEIGHT, MIRROR.low, MIRROR.high)


@pytest.fixture(params=[faces, layered], ids=["faces", "layered"])
def camera(request: pytest.FixtureRequest) -> Callable[..., OmniCamera]:
    """A camera in a world, with each of the renderers."""

    def make(world: World, seed: int = 0, noise: float = 0.0) -> OmniCamera:
        rng = np.random.default_rng(seed)
        return OmniCamera(world, rng, noise=noise, renderer=request.param(world))

    return make


def pose(heading: float = 0.0, x: float = 0.0, y: float = 0.0) -> Pose:
    return Pose(x=x, y=y, heading=heading)


def has_colour(pixel: np.ndarray, channels: tuple[int, ...]) -> bool:
    others = [channel for channel in range(3) if channel not in channels]
    return bool(min(pixel[list(channels)]) > 100 and max(pixel[others]) < 20)


# 0.05 m above the floor, 0.29 m away: a little below the horizon
def wall_row(panorama: np.ndarray) -> int:
    share = (np.degrees(MIRROR.high) + 6) / np.degrees(MIRROR.high - MIRROR.low)
    return int(share * len(panorama))


def test_shapes(camera: Callable[..., OmniCamera], world: World) -> None:
    image = camera(world).mirror_image(pose())
    assert image.shape == (160, 160, 3)
    assert image.dtype == np.uint8
    panorama = camera(world).panorama(pose())
    assert panorama.shape == (48, 240, 3)
    assert panorama.dtype == np.uint8


@pytest.mark.parametrize(
    ("share", "colour"), [(0.5, RED), (0.25, GREEN), (0.0, BLUE), (0.75, YELLOW)]
)
def test_the_panorama_shows_each_wall_on_its_side(
    camera: Callable[..., OmniCamera], world: World, share: float, colour: tuple[int]
) -> None:
    panorama = camera(world).panorama(pose())
    assert has_colour(panorama[wall_row(panorama), int(share * 240)], colour)


@pytest.mark.parametrize(
    ("step", "colour"), [((0, -1), RED), ((-1, 0), GREEN), ((0, 1), BLUE), ((1, 0), YELLOW)]
)
def test_the_mirror_shows_front_up_and_left_left(
    camera: Callable[..., OmniCamera], world: World, step: tuple[int, int], colour: tuple[int]
) -> None:
    image = camera(world).mirror_image(pose())
    radius = MIRROR.inner + 44 / 70 * (MIRROR.outer - MIRROR.inner)
    x, y = (round(79.5 + radius * part) for part in step)
    assert has_colour(image[y, x], colour)


@pytest.mark.parametrize("degrees", [15, 30, 45, 90, 180, 270, -60])
def test_turning_the_robot_turns_the_panorama(
    camera: Callable[..., OmniCamera], world: World, degrees: int
) -> None:
    straight = camera(world).panorama(pose()).astype(int)
    turned = camera(world).panorama(pose(np.radians(degrees))).astype(int)
    # a turn to the left moves the world to the right, 1.5 degrees a column
    moved = np.roll(straight, round(degrees / 1.5), axis=1)
    difference = np.abs(turned - moved).max(axis=2)
    assert np.mean(difference > 40) < 0.06


def test_the_mirror_image_holds_the_panorama(
    camera: Callable[..., OmniCamera], world: World
) -> None:
    at = pose(0.7, 0.1, -0.05)
    image, panorama = camera(world).mirror_image(at), camera(world).panorama(at)
    column, row = np.meshgrid(np.arange(240), np.arange(48))
    azimuth = pi - (column + 0.5) * 2 * pi / 240
    elevation = MIRROR.high - (row + 0.5) * (MIRROR.high - MIRROR.low) / 48
    share = (elevation - MIRROR.low) / (MIRROR.high - MIRROR.low)
    radius = MIRROR.inner + share * (MIRROR.outer - MIRROR.inner)
    x = np.rint(MIRROR.centre_x - radius * np.sin(azimuth)).astype(int)
    y = np.rint(MIRROR.centre_y - radius * np.cos(azimuth)).astype(int)
    # a pixel's width of blending at the edges of walls
    difference = np.abs(image[y, x].astype(int) - panorama).max(axis=2)
    assert np.mean(difference > 8) < 0.15
    assert np.median(difference) == 0


def test_beside_the_mirror_it_is_black(camera: Callable[..., OmniCamera], world: World) -> None:
    image = camera(world, noise=5.0).mirror_image(pose())
    y, x = np.mgrid[0:160, 0:160]
    radius = np.hypot(x - 79.5, y - 79.5)
    assert not image[(radius < 15) | (radius > 79)].any()
    assert image[(radius > 17) & (radius < 77)].any(axis=1).all()


def test_the_sky_has_its_colour(camera: Callable[..., OmniCamera], world: World) -> None:
    panorama = camera(world).panorama(pose())
    assert panorama[0, 0].tolist() == [round(255 * share) for share in (0.9, 0.7, 0.5)]


def test_the_floor_is_painted_as_pybullet_would_render_it(
    camera: Callable[..., OmniCamera], world: World
) -> None:
    rendering = OmniCamera(world, np.random.default_rng(0), noise=0.0, renderer=faces(world))
    client = not_none(world.dynamics).client
    plate = pybullet.createVisualShape(
        pybullet.GEOM_BOX,
        halfExtents=[0.2, 0.2, 0.0005],
        rgbaColor=[*world.arena.floor, 1],
        physicsClientId=client,
    )
    seen = camera(world).mirror_image(pose())
    body = pybullet.createMultiBody(0, -1, plate, [0, 0, 0.0005], physicsClientId=client)
    rendered = rendering.mirror_image(pose())
    pybullet.removeBody(body, physicsClientId=client)
    np.testing.assert_array_equal(seen[79, 60], rendered[79, 60])
    assert seen[79, 60].any()


def test_nearer_walls_are_larger(camera: Callable[..., OmniCamera], world: World) -> None:
    def height(x: float) -> int:
        column = camera(world).panorama(pose(0.0, x))[:, 120]
        return sum(has_colour(pixel, RED) for pixel in column)

    assert height(0.2) > height(0.0) > height(-0.2) > 0


def test_noise_is_seeded_and_as_large_as_told(
    camera: Callable[..., OmniCamera], world: World
) -> None:
    clean = camera(world).panorama(pose()).astype(int)
    first = camera(world, 1, 2.0)
    pictures = [first.panorama(pose()) for _ in range(3)]
    same, other = camera(world, 1, 2.0), camera(world, 2, 2.0)
    for picture in pictures:
        np.testing.assert_array_equal(same.panorama(pose()), picture)
    assert not np.array_equal(other.panorama(pose()), pictures[0])
    assert not np.array_equal(pictures[0], pictures[1])
    middle = (clean > 20) & (clean < 235)
    assert np.std((pictures[0] - clean)[middle]) == pytest.approx(2.0, rel=0.1)


POSTS = """
[[cylinder]]
centre = [0.15, 0.1]
radius = 0.03
colour = [0.9, 0.1, 0.2]
"""


@pytest.fixture(
    scope="module",
    params=["corridor", "corridor-mirror", "corridor-18", "s-curve", "maze", "open-box", "posts"],
)
def plain(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[World]:
    """An arena of walls and posts, and places in it."""
    name = request.param
    if name == "posts":
        path = tmp_path_factory.mktemp("arena") / "posts.toml"
        with resources.as_file(resources.files("khepera_emulator") / "arenas") as folder:
            path.write_text((folder / "open-box.toml").read_text() + POSTS)
        name = str(path)
    made = World(load_arena(name), rigid=True)
    yield made
    made.close()


@pytest.mark.parametrize(("heading", "aside"), [(0.3, 0.0), (2.0, 0.03), (-1.0, -0.04)])
def test_the_fast_renderer_draws_what_pybullet_does(
    plain: World, heading: float, aside: float
) -> None:
    start = plain.arena.start
    at = pose(heading, start.x + aside, start.y + aside)
    pictures = []
    for renderer in (layered(plain), faces(plain, 192)):
        seen = OmniCamera(plain, np.random.default_rng(0), noise=0.0, renderer=renderer)
        pictures.append(seen.mirror_image(at).astype(int))
    difference = np.abs(pictures[0] - pictures[1]).max(axis=2)
    # faces and floor in the same colours; edges differ by less than a pixel
    assert np.median(difference) == 0
    assert np.mean(difference > 4) < 0.08
    assert np.mean(difference > 60) < 0.02


THINGS = """
[[object]]
shape = "box"
centre = [0.16, 0.02]
heading = 20
size = [0.05, 0.03]
height = 0.03
colour = [0.85, 0.2, 0.2]

[[object]]
shape = "post"
centre = [0.0, -0.13]
radius = 0.02
height = 0.13
colour = [0.2, 0.4, 0.85]

[[object]]
shape = "ball"
centre = [0.01, 0.12]
radius = 0.03
colour = [0.95, 0.75, 0.1]
"""
LOW_WALLS = """
[[wall]]
points = [[-0.12, -0.1], [-0.12, 0.1], [-0.2, 0.15]]
height = 0.03
colour = [0.2, 0.7, 0.3]

[[wall]]
points = [[0.2, -0.2], [0.2, 0.2]]
height = 0.08
colour = [0.7, 0.2, 0.6]

[[cylinder]]
centre = [-0.3, 0.0]
radius = 0.04
height = 0.2
colour = [0.8, 0.7, 0.2]
"""
LAMPS = """
[[lamp]]
centre = [0.15, 0.02]

[[lamp]]
centre = [-0.05, 0.1]
"""
CROWDED = {
    "things": THINGS,
    "low walls": LOW_WALLS,
    "lamps": LAMPS,
    "all": THINGS + LOW_WALLS + LAMPS,
    "robots": "",
}


@pytest.fixture(scope="module", params=list(CROWDED))
def crowded(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[World, Chassis | None]]:
    """An open box with more in it than walls, and a robot that the camera is on, if others are."""
    path = tmp_path_factory.mktemp("arena") / "crowded.toml"
    with resources.as_file(resources.files("khepera_emulator") / "arenas") as folder:
        path.write_text((folder / "open-box.toml").read_text() + CROWDED[request.param])
    shared = request.param == "robots"
    made = World(load_arena(str(path)), shared=shared, rigid=True)
    places = [(0.0, 0.0), (0.12, 0.05), (-0.1, -0.2), (0.19, 0.08)] if shared else []
    robots = [Chassis(made, KHEPERA, IDEAL, pose(0.4, x, y)) for x, y in places]
    yield made, robots[0] if robots else None
    made.close()


@pytest.mark.parametrize(
    ("heading", "x", "y"), [(0.0, 0.0, 0.0), (2.0, 0.03, 0.02), (-1.3, -0.04, -0.03)]
)
def test_all_that_stands_before_the_walls_is_drawn_as_by_pybullet(
    crowded: tuple[World, Chassis | None], heading: float, x: float, y: float
) -> None:
    world, carrier = crowded
    at = pose(heading, x, y)
    own = LayeredRenderer(world, HEIGHT, MIRROR.low, MIRROR.high, carrier)
    body = None if carrier is None else carrier.rigid
    reference = FacesRenderer(world, HEIGHT, MIRROR.low, MIRROR.high, 192, body)
    if carrier is not None:
        carrier.place(at)
    pictures = [
        OmniCamera(world, np.random.default_rng(0), noise=0.0, renderer=each).mirror_image(at)
        for each in (own, reference)
    ]
    difference = np.abs(pictures[0].astype(int) - pictures[1]).max(axis=2)
    # edges differ by less than a pixel; what is round has corners in PyBullet, and other light
    assert np.median(difference) == 0
    assert np.mean(difference) < 3.5
    assert np.mean(difference > 4) < 0.13
    assert np.mean(difference > 30) < 0.04
    assert np.mean(difference > 60) < 0.01


@pytest.mark.parametrize("side", [0.0, 90.0, 200.0])
def test_the_light_on_a_ball_is_as_in_pybullet(side: float) -> None:
    place = [0.12 * np.cos(np.radians(side)), 0.12 * np.sin(np.radians(side))]
    ball = {"shape": "ball", "centre": place, "radius": 0.05, "colour": [1.0, 0.0, 0.0]}
    made = World(arena(object=[ball]))
    drawn = [
        OmniCamera(made, np.random.default_rng(0), noise=0.0, renderer=renderer)
        .mirror_image(pose())
        .astype(int)
        for renderer in (layered(made), faces(made, 192))
    ]
    made.close()
    on_both = np.all([picture[:, :, 1] == 0 for picture in drawn], axis=0)
    on_both &= drawn[0][:, :, 2] > 0
    reds = [picture[on_both][:, 2] for picture in drawn]
    assert len(reds[0]) > 300
    assert np.ptp(reds[1]) > 40
    assert np.mean(np.abs(reds[0] - reds[1])) < 8


@pytest.mark.parametrize("with_numpy", [True, False])
def test_pictures_are_the_same_from_a_pybullet_without_numpy(
    world: World, monkeypatch: pytest.MonkeyPatch, with_numpy: bool
) -> None:
    expected = faces(world).render(pose(0.3))
    draw = pybullet.getCameraImage

    def given(
        *arguments: int | tuple[float, ...], **more: Any
    ) -> tuple[int | np.ndarray | tuple[int, ...], ...]:
        width, height, pixels, depth, body = draw(*arguments, **more)
        if with_numpy:
            pixels = np.asarray(pixels, np.uint8).reshape(height, width, 4)
            body = np.asarray(body, np.int32).reshape(height, width)
        else:
            pixels, body = (tuple(np.asarray(part).ravel().tolist()) for part in (pixels, body))
        return width, height, pixels, depth, body

    monkeypatch.setattr(pybullet, "getCameraImage", given)
    assert (faces(world).render(pose(0.3)) == expected).all()


def test_an_empty_arena_is_floor_and_sky() -> None:
    empty = load_arena("corridor").model_copy(update={"wall": []})
    made = World(empty, rigid=True)
    seen = [
        OmniCamera(made, np.random.default_rng(0), noise=0.0, renderer=renderer(made)).panorama(
            pose()
        )
        for renderer in (layered, faces)
    ]
    made.close()
    assert np.mean(seen[0] != seen[1]) < 0.05
    assert seen[0][0, 0].tolist() == [255, 255, 255]
