"""The inside of an arena: where robots get to that cannot leave, and no place beyond."""

from math import cos, pi, sin

import numpy as np
import pytest
from khepera_protocol.zenoh.payloads import Pose, Reset
from worlds import arena, reachable

from khepera_emulator.arenas.arena import Arena, arena_names, load_arena
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import KHEPERA, KHEPERA2, Model
from khepera_emulator.robot.emulator import Setup, make_fleet
from khepera_emulator.world.enclosure import Enclosure
from khepera_emulator.world.floor_plan import FloorPlan

RADIUS = KHEPERA2.radius
ROOM = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]


def enclosure(given: Arena, radius: float = RADIUS) -> Enclosure:
    return Enclosure(FloorPlan(given), given.start, radius)


@pytest.mark.parametrize("model", [KHEPERA, KHEPERA2], ids=lambda model: model.name)
@pytest.mark.parametrize("name", arena_names())
def test_is_what_a_robot_can_reach_from_the_start(name: str, model: Model) -> None:
    step = 0.01
    given = load_arena(name)
    plan, inside = FloorPlan(given), enclosure(given, model.radius)
    there = {(round(x / step), round(y / step)) for x, y in reachable(name, model, step)}
    for i in range(-50, 250):
        for j in range(-150, 150):
            if plan.clearance(i * step, j * step) > model.radius:
                assert inside.holds(i * step, j * step) == ((i, j) in there), (i, j)


@pytest.mark.parametrize(
    ("width", "closed"), [(0.0, True), (0.02, True), (0.05, True), (0.08, False), (0.2, False)]
)
def test_ends_at_openings_that_are_too_narrow_for_a_robot(width: float, closed: bool) -> None:
    door = [(-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5), (0.5, -width / 2), (0.5, 0.5), (-0.5, 0.5)]
    walls = [door[:4], [(0.5, width / 2), *door[4:]]]
    # a wall is longer than its points by half of its thickness at either end
    given = arena(wall=[{"points": wall, "thickness": 0.001} for wall in walls])
    assert enclosure(given).holds(0.4, 0.4)
    assert enclosure(given).holds(0.7, 0.0) != closed
    assert enclosure(given).holds(-3.0, 8.0) != closed


def test_is_everywhere_where_nothing_encloses_the_start() -> None:
    for given in (
        arena(),
        arena(wall=[{"points": ROOM}], start={"x": 2, "y": 0}),
        arena(cylinder=[{"centre": (0.2, 0.2), "radius": 0.1}]),
    ):
        assert enclosure(given).holds(-9.9, 9.9)


def test_has_several_rooms() -> None:
    points = [*ROOM, ROOM[0], (0.0, -0.5), (0.0, 0.5)]
    inside = enclosure(arena(wall=[{"points": points}], start={"x": -0.2, "y": 0.0}))
    assert inside.holds(-0.3, 0.3)
    assert inside.holds(0.3, -0.3)
    assert not inside.holds(0.6, 0.0)


@pytest.mark.parametrize("scale", [0.1, 1.0, 9.0])
def test_is_as_fine_as_the_arena_is_small(scale: float) -> None:
    ring = [(scale * cos(k), scale * sin(k)) for k in np.linspace(0.0, 2 * pi, 40)]
    inside = enclosure(arena(wall=[{"points": ring}]))
    for angle in np.linspace(0.0, 2 * pi, 30):
        assert inside.holds(*((scale - 0.04) * np.array([cos(angle), sin(angle)])))
        assert not inside.holds(*((scale + 0.04) * np.array([cos(angle), sin(angle)])))


def test_posts_enclose_as_well_as_walls() -> None:
    posts = [
        {"centre": (0.4 * cos(k), 0.4 * sin(k)), "radius": 0.02}
        for k in np.linspace(0.0, 2 * pi, 40, endpoint=False)
    ]
    assert not enclosure(arena(cylinder=posts)).holds(0.5, 0.0)
    assert enclosure(arena(cylinder=posts[:-2])).holds(0.5, 0.0)


def test_holds_robots_wherever_they_are_put() -> None:
    given = arena(
        wall=[{"points": [*ROOM, ROOM[0]]}],
        free={"points": [[-2.0, 0.0], [2.0, 0.0]], "half_width": 2.0},
    )
    robots = make_fleet(Setup(given), 8)
    try:
        places = [robot.start_pose for robot in robots]
        places += [robots[0].reset(Reset(random=True, seed=seed)).pose for seed in range(20)]
        assert all(max(abs(pose.x), abs(pose.y)) < 0.5 for pose in places)
        with pytest.raises(EmulatorError, match="outside the walls"):
            robots[0].reset(Reset(pose=Pose(x=1.0, y=0.0, heading=0.0)))
    finally:
        robots[0].close()
    with pytest.raises(EmulatorError, match="outside the walls"):
        make_fleet(
            Setup(given.model_copy(update={"starts": [given.start.model_copy(update={"x": 1.0})]})),
            2,
        )
