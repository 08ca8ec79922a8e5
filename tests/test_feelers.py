"""Feelers find a collision where the infrared sensors are saturated, and where the body touches."""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot

import numpy as np
import pytest
from khepera_protocol.zenoh.payloads import Outline, Pose, Solid
from worlds import arena

from khepera_emulator.arenas.arena import Arena, arena_names, load_arena
from khepera_emulator.models import KHEPERA, KHEPERA2, Model
from khepera_emulator.robot.epuck.models import EPUCK, EPUCK2
from khepera_emulator.robot.epuck.senses.proximity import Ring
from khepera_emulator.routes.feelers import Feelers, Poses, solids_of
from khepera_emulator.senses.infrared import Infrared, sensor_ring
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.outline import outline

COLLISION = 1000
EPUCK_COLLISION = 600
HERE = np.zeros((1, 3))

ONE_COLOUR = [
    name
    for name in arena_names()
    if not load_arena(name).object and len({wall.colour for wall in load_arena(name).wall}) == 1
]


def feelers(made: Arena, model: Model = KHEPERA, margin: float = 0.0) -> Feelers:
    collision = COLLISION if model.kind == "khepera" else EPUCK_COLLISION
    return Feelers(solids_of(outline(made, model)), model, collision, margin)


def touches(
    made: Arena,
    poses: Sequence[np.ndarray | tuple[float, float, float]] | np.ndarray,
    model: Model = KHEPERA,
    margin: float = 0.0,
) -> np.ndarray:
    x, y, heading = np.array(poses, dtype=float).T
    return feelers(made, model, margin).touch(Poses(x, y, heading), HERE)[:, 0]


def near_walls(made: Arena, count: int, seed: int = 0) -> list[np.ndarray]:
    """Poses in whose reach something is."""
    plan = FloorPlan(made)
    (x0, y0), (x1, y1) = plan.bounds()
    drawn = np.random.default_rng(seed).uniform([x0, y0, -7.0], [x1, y1, 7.0], (20 * count, 3))
    return [pose for pose in drawn if 0.02 < plan.clearance(pose[0], pose[1]) < 0.06][:count]


def saturated(made: Arena, poses: list[np.ndarray], model: Model) -> list[bool]:
    """The same as the sensors themselves tell it, one pose after the other."""
    plan = FloorPlan(made)
    infrared = Infrared(model, plan, [], np.random.default_rng(0))
    return [
        plan.clearance(x, y) <= model.radius
        or any(
            infrared.response(sensor, gap) >= COLLISION
            for sensor, gap in enumerate(infrared.gaps(x, y, heading)[:6])
        )
        for x, y, heading in poses
    ]


def epuck_near(made: Arena, poses: list[np.ndarray]) -> list[bool]:
    """The same of an e-puck's own sensors, whose zeros are taken off."""
    plan, zeros = FloorPlan(made), EPUCK2.offsets
    ring = Ring(
        replace(EPUCK2, proximity=replace(EPUCK2.proximity, noise=(0.0, 0.0))),
        plan,
        [],
        np.random.default_rng(0),
    )
    scans = [np.subtract(ring.reflected(*pose), zeros) for pose in poses]
    return [
        plan.clearance(x, y) <= EPUCK2.radius
        or bool(scan[[0, 1, 2, 5, 6, 7]].max() >= EPUCK_COLLISION)
        for (x, y, _), scan in zip(poses, scans, strict=True)
    ]


@pytest.mark.parametrize("name", ["corridor", "open-box", "maze", "lamp-room"])
def test_an_epucks_agree_with_its_sensors(name: str) -> None:
    made = load_arena(name)
    poses = near_walls(made, 400)
    told, true = touches(made, poses, EPUCK2), epuck_near(made, poses)
    assert 0.1 < told.mean() < 0.9
    assert not (true & ~told).any()
    assert (told & ~np.array(true)).sum() <= (2 if name in {"maze", "lamp-room"} else 0)
    assert (told == touches(made, poses, EPUCK)).all()


@pytest.mark.parametrize("colour", [1.0, 0.5, 0.0])
def test_an_epuck_feels_dark_walls_later(colour: float) -> None:
    wall = arena(wall=[{"points": [[0.105, -1.0], [0.105, 1.0]], "colour": [colour] * 3}])
    ahead = [(x, 0.0, 0.0) for x in np.arange(0.0, 0.08, 1e-4)]
    felt = float(ahead[touches(wall, ahead, EPUCK2).argmax()][0])
    poses = [np.array(pose) for pose in ahead]
    assert felt == pytest.approx(ahead[epuck_near(wall, poses).index(True)][0], abs=1e-9)


@pytest.mark.parametrize("model", [KHEPERA, KHEPERA2], ids=lambda model: model.name)
@pytest.mark.parametrize("name", ONE_COLOUR)
def test_they_agree_with_the_sensors(name: str, model: Model) -> None:
    made = load_arena(name)
    poses = near_walls(made, 400)
    told = touches(made, poses, model)
    assert 0.1 < told.mean() < 0.9
    assert told.tolist() == saturated(made, poses, model)


@pytest.mark.parametrize("name", ["maze", "narrow-passage", "lamp-room"])
def test_among_colours_they_never_miss_a_collision(name: str) -> None:
    made = load_arena(name)
    poses = near_walls(made, 1000)
    told, true = touches(made, poses), np.array(saturated(made, poses, KHEPERA))
    assert not (true & ~told).any()
    assert (told & ~true).sum() <= 5  # a ray that meets two colours at a corner


def test_a_margin_is_kept() -> None:
    wall = arena(wall=[{"points": [[0.105, -1.0], [0.105, 1.0]]}])
    ahead = [(x, 0.0, 0.0) for x in np.arange(0.0, 0.08, 1e-4)]
    without, kept = touches(wall, ahead), touches(wall, ahead, margin=0.002)
    assert without.argmax() - kept.argmax() == pytest.approx(20, abs=1)


@pytest.mark.parametrize(("colour", "closer"), [(1.0, 0.0), (0.5, 0.003), (0.0, 0.01)])
def test_dark_walls_are_felt_later(colour: float, closer: float) -> None:
    wall = {"points": [[0.105, -1.0], [0.105, 1.0]], "colour": [colour] * 3}
    ahead = [(x, 0.0, 0.0) for x in np.arange(0.0, 0.08, 1e-4)]
    white = touches(arena(wall=[{**wall, "colour": [1.0] * 3}]), ahead).argmax()
    assert touches(arena(wall=[wall]), ahead).argmax() >= white + closer / 1e-4


def test_what_is_behind_counts_when_the_body_touches_it() -> None:
    wall = arena(wall=[{"points": [[0.105, -1.0], [0.105, 1.0]]}])
    gaps = np.array([0.001, -0.001])
    away = [(0.1 - KHEPERA.radius - gap, 0.0, np.pi) for gap in gaps]
    assert touches(wall, away).tolist() == [False, True]


def test_every_step_is_looked_at_from_every_pose() -> None:
    made = load_arena("maze")
    poses = near_walls(made, 50)
    steps = np.array([[0.0, 0.0, 0.0], [0.01, 0.002, 0.1], [0.02, -0.004, -0.3]])
    x, y, heading = np.array(poses).T
    told = feelers(made).touch(Poses(x, y, heading), steps)
    for k, (ahead, left, turn) in enumerate(steps):
        c, s = np.cos(heading), np.sin(heading)
        there = np.stack([x + c * ahead - s * left, y + s * ahead + c * left, heading + turn])
        assert told[:, k].tolist() == touches(made, there.T).tolist()


def test_an_empty_floor_touches_nobody() -> None:
    assert not touches(arena(), [(0.0, 0.0, 0.0)]).any()


def drawn(*shapes: list[tuple[float, float]]) -> Outline:
    solids = [Solid(corners=corners, colour=(1.0, 1.0, 1.0)) for corners in shapes]
    start = Pose(x=0.0, y=0.0, heading=0.0)
    return Outline(title="", floor=(0, 0, 0), solids=solids, start=start, robot_radius=0.0275)


def test_rectangles_and_discs_are_known_by_their_corners() -> None:
    made = load_arena("lamp-room")
    solids = solids_of(outline(made, KHEPERA))
    plan = FloorPlan(made)
    count = len(plan.boxes)
    sizes = sorted(zip(solids.half_length[:count], solids.half_thickness[:count], strict=True))
    expected = sorted((box.half_length, box.half_thickness) for box in plan.boxes)
    assert np.ravel(sizes) == pytest.approx(np.ravel(expected))
    assert solids.radius.tolist()[:count] == [0.0] * count
    discs = np.stack([solids.x, solids.y, solids.radius], axis=1)[count:]
    assert discs.ravel() == pytest.approx(np.ravel(plan.posts))


@pytest.mark.parametrize(
    "corners",
    [
        [(0.1, 0.0), (0.2, 0.0), (0.15, 0.08)],
        [(0.1, 0.0), (0.2, 0.0), (0.22, 0.05), (0.12, 0.05)],
        [(0.1, 0.0), (0.2, 0.0), (0.2, 0.0), (0.15, 0.08)],
    ],
    ids=["triangle", "parallelogram", "a corner twice"],
)
def test_other_shapes_are_their_edges(corners: list[tuple[float, float]]) -> None:
    solids = solids_of(drawn(corners))
    edges = [(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True) if a != b]
    assert solids.half_length * 2 == pytest.approx([hypot(*np.subtract(b, a)) for a, b in edges])
    assert not solids.half_thickness.any()
    told = Feelers(solids, KHEPERA, COLLISION, 0.0)
    # its tip is 20 mm from the body, and then 10 mm beside it
    x, y = corners[0]
    poses = Poses(np.array([x - 0.0675, x]), np.array([y, y - 0.0375]), np.zeros(2))
    assert told.touch(poses, HERE)[:, 0].tolist() == [False, True]


@pytest.mark.parametrize("model", [KHEPERA, KHEPERA2], ids=lambda model: model.name)
def test_the_gap_of_a_reading_is_where_it_is_read(model: Model) -> None:
    infrared = Infrared(model, FloorPlan(arena()), [], np.random.default_rng(0))
    for number, sensor in enumerate(sensor_ring(model)):
        for count in (COLLISION, 500):
            gap = sensor.gap_of(count)
            assert infrared.response(number, gap) == pytest.approx(count)
            assert infrared.response(number, gap + 1e-4) < count
        assert sensor.gap_of(1e6) == -np.inf
