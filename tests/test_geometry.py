"""The plan of an arena against PyBullet: rays and distances at random places."""

from collections.abc import Iterator
from math import cos, inf, pi, sin
from typing import Any

import numpy as np
import pybullet
import pytest
from as_type import not_none

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.things import SOLID_GROUP
from khepera_emulator.world.world import World

HEIGHT = 0.02


def arena(**parts: Any) -> Arena:
    return Arena.model_validate(
        {
            "version": 1,
            "title": "test",
            "start": {"x": 0, "y": 0},
            "free": {"points": [[0, 0], [0.1, 0]], "half_width": 0.1},
            **parts,
        }
    )


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    made = World(
        arena(
            wall=[
                {"points": [[-0.5, -0.5], [0.5, -0.5], [0.6, 0.4], [-0.4, 0.5]]},
                {"points": [[-0.3, 0.0], [-0.1, 0.2]], "thickness": 0.05, "colour": [0, 0, 0]},
            ],
            cylinder=[
                {"centre": [0.2, 0.1], "radius": 0.05, "colour": [0.5, 0.5, 0.5]},
                {"centre": [0.1, -0.3], "radius": 0.01},
            ],
        ),
        rigid=True,
    )
    yield made
    made.close()


def test_rays_equal_those_of_pybullet(world: World) -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(-0.7, 0.7, (4000, 2))
    # PyBullet's rays pass through the solid that they begin in
    outside = np.array([world.plan.clearance(x, y) > 1e-3 for x, y in places])
    places = places[outside]
    angles = rng.uniform(-pi, pi, len(places))
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    start = np.column_stack([places, np.full(len(places), HEIGHT)])
    end = np.column_stack([places + 2.0 * rays, np.full(len(places), HEIGHT)])
    expected = 2.0 * not_none(world.dynamics).cast(start, end)
    distances, _ = world.plan.cast(places, rays)
    measured = np.minimum(distances, 2.0)
    assert len(places) > 3000
    # PyBullet rounds edges and posts by up to its margin of 1 mm, and a grazing ray may miss
    assert np.mean(np.abs(measured - expected) > 1e-3) < 0.01
    assert np.median(np.abs(measured - expected)) < 1e-5


def test_clearance_equals_the_distance_in_pybullet(world: World) -> None:
    dynamics = not_none(world.dynamics)
    client, probe_radius = dynamics.client, 0.001
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_SPHERE, radius=probe_radius, physicsClientId=client
    )
    probe = pybullet.createMultiBody(0, shape, physicsClientId=client)
    pybullet.setCollisionFilterGroupMask(
        probe, -1, SOLID_GROUP, SOLID_GROUP, physicsClientId=client
    )
    compared = 0
    for x, y in np.random.default_rng(1).uniform(-0.45, 0.45, (300, 2)):
        gap = world.plan.clearance(x, y)
        if gap < 0.005:
            continue
        pybullet.resetBasePositionAndOrientation(
            probe, [x, y, HEIGHT], [0, 0, 0, 1], physicsClientId=client
        )
        near = [
            point
            for solid in dynamics.solids
            for point in pybullet.getClosestPoints(probe, solid, 2.0, physicsClientId=client)
        ]
        # PyBullet rounds a post's mantle by its collision margin
        assert min(point[8] for point in near) + probe_radius == pytest.approx(gap, abs=1e-3)
        compared += 1
    pybullet.removeBody(probe, physicsClientId=client)
    assert compared > 200


def test_a_point_inside_a_solid_has_no_clearance(world: World) -> None:
    assert world.plan.clearance(-0.2, 0.1) < 0
    assert world.plan.clearance(0.2, 0.1) == pytest.approx(-0.05)


def test_grey_of_what_was_hit(world: World) -> None:
    at = np.array([[-0.2, 0.25], [0.3, 0.1], [0.0, 0.45]])
    to = np.array([[cos(-pi / 2), sin(-pi / 2)], [-1.0, 0.0], [0.0, -1.0]])
    _, grey = world.plan.cast(at, to)
    assert grey.tolist() == [0.0, 0.5, 1.0]


@pytest.mark.parametrize("angle", [0.0, pi / 2, pi, -pi / 2])
def test_rays_along_the_axes(angle: float) -> None:
    square = [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2]]
    plan = FloorPlan(arena(wall=[{"points": square}]))
    distances, _ = plan.cast(np.zeros((1, 2)), np.array([[round(cos(angle)), round(sin(angle))]]))
    assert distances[0] == pytest.approx(0.195)


def test_a_ray_beside_a_wall_and_along_it_misses() -> None:
    plan = FloorPlan(arena(wall=[{"points": [[0.1, 0.0], [0.3, 0.0]]}]))
    distances, _ = plan.cast(np.array([[0.0, 0.0051], [0.0, 0.0]]), np.array([[1.0, 0.0]] * 2))
    assert distances[0] == inf
    assert distances[1] == pytest.approx(0.095)


def test_an_empty_arena_is_all_free() -> None:
    plan = FloorPlan(arena())
    distances, grey = plan.cast(np.zeros((2, 2)), np.array([[1.0, 0.0], [0.0, 1.0]]))
    assert distances.tolist() == [inf, inf]
    assert grey.tolist() == [1.0, 1.0]
    assert plan.clearance(0.0, 0.0) == inf
