"""Boxes and discs in plain numbers, against the same in arrays."""

from math import cos, inf, pi, sin

import numpy as np
import pytest
from worlds import arena

from khepera_emulator.arenas.arena import Wall
from khepera_emulator.world.floor_plan import NEAR, FloorPlan, Surroundings
from khepera_emulator.world.solids import Box, Brick, Disc, wall_boxes

SOLIDS: dict[str, Box | Disc | Brick] = {
    "box": wall_boxes(Wall(points=[(0.1, 0.0), (0.2, 0.1)], thickness=0.03))[0],
    "disc": Disc(0.1, -0.05, 0.04, 0.5),
    "brick": Brick(-0.05, 0.1, 0.4, (0.06, 0.02), 0.5),
}


def cast(solid: Box | Disc | Brick, places: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Distances by arrays."""
    if isinstance(solid, Box):
        solid = Brick(
            solid.x,
            solid.y,
            np.arctan2(solid.uy, solid.ux),
            (2 * solid.half_length, 2 * solid.half_thickness),
            0.0,
        )
    return solid.hit(places, rays)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_ray_goes_as_far_as_in_arrays(name: str) -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(-0.2, 0.3, (2000, 2))
    angles = rng.uniform(-pi, pi, len(places))
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    solid = SOLIDS[name]
    found = [
        solid.ray(*place, *ray) for place, ray in zip(places.tolist(), rays.tolist(), strict=True)
    ]
    expected = cast(solid, places, rays)
    assert found == pytest.approx(expected.tolist(), abs=1e-12)
    assert 0.05 < np.mean(expected < inf) < 0.95
    assert 0.0 in found


@pytest.mark.parametrize("name", SOLIDS)
def test_the_way_toward_a_solid_is_the_shortest_one(name: str) -> None:
    solid = SOLIDS[name]
    angles = np.linspace(-pi, pi, 3600)
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    inside = 0
    for x, y in np.random.default_rng(1).uniform(-0.1, 0.2, (300, 2)).tolist():
        gap, nx, ny = solid.toward(x, y)
        assert gap == pytest.approx(solid.gap(x, y), abs=1e-15)
        assert nx**2 + ny**2 == pytest.approx(1.0)
        # the end of the way lies on the surface, from inside as well
        assert solid.gap(x + gap * nx, y + gap * ny) == pytest.approx(0.0, abs=1e-12)
        assert solid.gap(x + (gap + 1e-6) * nx, y + (gap + 1e-6) * ny) < 0.0
        if gap > 0.0:
            shortest = cast(solid, np.tile([x, y], (len(rays), 1)), rays).min()
            assert gap - 1e-12 <= shortest <= gap * 1.001 + 1e-6
        inside += gap < 0.0
    assert inside > 0


def test_a_disc_s_middle_has_a_way_out() -> None:
    gap, nx, ny = Disc(0.1, 0.2, 0.05, 1.0).toward(0.1, 0.2)
    assert (gap, nx**2 + ny**2) == (-0.05, 1.0)


def test_near_is_what_is_within_reach_and_nothing_is_forgotten() -> None:
    plan = FloorPlan(
        arena(
            wall=[{"points": [[-1.0, -0.5], [1.0, -0.5], [1.2, 0.4], [-0.4, 0.5]]}],
            cylinder=[
                {"centre": [0.2, 0.1], "radius": 0.05},
                {"centre": [2.0, 0.1], "radius": 0.1},
            ],
        )
    )
    everything: list[Box | Disc] = [*plan.boxes, *(Disc(*post, 1.0) for post in plan.posts)]
    mover, own = Disc(0.0, 0.0, 0.03, 0.5), Disc(0.1, 0.0, 0.03, 0.5)
    scene = Surroundings(plan, [mover, own], own)
    for x, y in np.random.default_rng(2).uniform(-1.5, 2.5, (500, 2)).tolist():
        gaps = [solid.gap(x, y) for solid in everything]
        assert plan.clearance(x, y) == min(gaps)
        for reach in (0.02, NEAR):
            within = sorted(gap for gap in gaps if gap <= reach)
            assert sorted(solid.gap(x, y) for solid in plan.near(x, y, reach)) == within
            movers = [mover] if mover.gap(x, y) <= reach else []
            assert scene.near(x, y, reach) == [*plan.near(x, y, reach), *movers]


def test_a_brick_turns() -> None:
    brick = Brick(0.0, 0.0, 0.0, (0.1, 0.02), 1.0)
    assert brick.gap(0.1, 0.0) == pytest.approx(0.05)
    brick.turn(pi / 2)
    assert brick.gap(0.1, 0.0) == pytest.approx(0.09)
    assert brick.ray(0.1, 0.0, cos(pi), sin(pi)) == pytest.approx(0.09)
