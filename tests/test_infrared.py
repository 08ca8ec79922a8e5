"""The infrared ring against what was recorded on real robots."""

from dataclasses import replace
from math import inf, radians
from typing import Any

import numpy as np
import pytest
from worlds import arena

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.models import KHEPERA, KHEPERA2, Model
from khepera_emulator.senses.infrared import Infrared
from khepera_emulator.world.floor_plan import FloorPlan, Surroundings
from khepera_emulator.world.solids import Brick, Disc, Footprint

# S. Nolfi's samples of a first Khepera: gap in mm, mean of the eight sensors at their lobes
NOLFI = {
    11: 1023, 13: 1023, 15: 1023, 17: 993, 19: 914, 21: 782, 23: 631, 25: 449, 27: 271, 29: 233,
    31: 161, 33: 97, 35: 55, 37: 30, 39: 26, 41: 12, 43: 3,
}  # fmt: skip

# five days of one Khepera II: gap in mm, mean of the eight sensors
KHEPERA2_MEAN = {
    10: 965, 20: 276, 30: 155, 40: 114, 50: 98, 60: 87, 70: 84, 80: 79, 90: 77, 100: 64,
}  # fmt: skip

# Nolfi's wall, lobe averaged over the sensors: (gap in mm, degrees off the lobe) -> counts
FALL_OFF = {
    (15, 0): 1023, (15, 18): 1000, (15, 30): 820, (15, 36): 590, (15, 42): 345, (15, 48): 165,
    (15, 54): 55, (15, 60): 17,
    (25, 0): 442, (25, 12): 380, (25, 18): 286, (25, 24): 225, (25, 30): 126, (25, 36): 49,
    (25, 48): 4,
}  # fmt: skip


def ring(model: Model, seed: int = 0, **parts: Any) -> Infrared:
    arena = Arena.model_validate(
        {
            "version": 1,
            "title": "test",
            "start": {"x": 0, "y": 0},
            "free": {"points": [[0, 0], [0.1, 0]], "half_width": 0.1},
            **parts,
        }
    )
    return Infrared(model, FloorPlan(arena), arena.lamp, np.random.default_rng(seed))


def before_wall(model: Model, gap: float, off: float = 0.0, noise: bool = False) -> list[float]:
    """Each sensor's reading with its lobe turned `off` degrees from a white wall's normal."""
    wall = {"points": [[1.005, -5.0], [1.005, 5.0]]}
    infrared = ring(model, wall=[wall])
    x = 1.0 - gap - model.radius
    readings: list[float] = []
    for sensor, direction in enumerate(model.sensor_directions):
        place = (x, 0.0, radians(off) - direction)
        if noise:
            readings.append(infrared.proximity(*place)[sensor])
        else:
            value = infrared.response(sensor, infrared.gaps(*place)[sensor])
            readings.append(min(max(value, 0.0), model.full_scale))
    return readings


@pytest.mark.parametrize(("gap", "counts"), NOLFI.items())
def test_khepera_before_a_wall_reads_as_recorded(gap: int, counts: int) -> None:
    # what a robot reads that sees nothing is noise, not the curve
    assert np.mean(before_wall(KHEPERA, gap / 1000)) == pytest.approx(counts, abs=2.5)


@pytest.mark.parametrize(("gap", "counts"), KHEPERA2_MEAN.items())
def test_khepera2_before_a_wall_reads_as_recorded(gap: int, counts: int) -> None:
    assert np.mean(before_wall(KHEPERA2, gap / 1000)) == pytest.approx(counts, abs=1)


@pytest.mark.parametrize(
    ("model", "gap"), [(KHEPERA, 0.017), (KHEPERA, 0.025), (KHEPERA2, 0.01), (KHEPERA2, 0.03)]
)
def test_each_sensor_has_its_own_curve(model: Model, gap: float) -> None:
    row = model.proximity.gaps.index(gap)
    recorded = [counts[row] for counts in model.proximity.counts]
    # also of the sensors that look up to 14 degrees aside of where they sit
    assert before_wall(model, gap) == pytest.approx(recorded, abs=1)


@pytest.mark.parametrize(("place", "counts"), FALL_OFF.items())
def test_reading_falls_off_with_the_angle_as_recorded(place: tuple[int, int], counts: int) -> None:
    gap, off = place
    both = [*before_wall(KHEPERA, gap / 1000, off), *before_wall(KHEPERA, gap / 1000, -off)]
    assert np.mean(both) == pytest.approx(counts, abs=55)


def test_reading_never_rises_with_the_angle() -> None:
    means = [np.mean(before_wall(KHEPERA, 0.020, off)) for off in range(0, 66, 6)]
    assert all(np.diff(means) <= 1.0)
    assert means[-1] < 60


def test_close_to_a_wall_the_reading_is_steady_at_full_scale() -> None:
    assert set(before_wall(KHEPERA, 0.005, noise=True)) == {1023}
    assert set(before_wall(KHEPERA2, 0.002, noise=True)) == {1020}


def test_khepera2_counts_in_fours() -> None:
    readings = [before_wall(KHEPERA2, gap / 1000, noise=True) for gap in range(5, 120, 5)]
    assert {value % 4 for row in readings for value in row} == {0}
    assert max(map(max, readings)) == 1020


def test_without_an_object_a_khepera_reads_near_nothing() -> None:
    infrared = ring(KHEPERA)
    readings = np.array([infrared.proximity(0.0, 0.0, 0.0) for _ in range(500)])
    assert infrared.gaps(0.0, 0.0, 0.0) == (inf,) * 8
    assert readings.min() == 0
    assert readings.max() <= 13
    # recorded: 48 % zeros, the rest 1 to 13
    assert np.mean(readings == 0) == pytest.approx(0.5, abs=0.1)


def test_without_an_object_a_khepera2_reads_its_residual() -> None:
    infrared = ring(KHEPERA2)
    readings = np.array([infrared.proximity(0.0, 0.0, 0.0) for _ in range(500)])
    residual = np.array(KHEPERA2.proximity.residual)
    assert readings.mean(axis=0) == pytest.approx(residual - 1.5, abs=3)


def test_noise_grows_with_the_reading_and_is_seeded() -> None:
    wall = [{"points": [[1.005, -5.0], [1.005, 5.0]]}]
    place = (1.0 - 0.021 - KHEPERA.radius, 0.0, 0.0)
    first, same, other = (ring(KHEPERA, seed, wall=wall) for seed in (1, 1, 2))
    readings = [first.proximity(*place) for _ in range(400)]
    assert [same.proximity(*place) for _ in range(400)] == readings
    assert [other.proximity(*place) for _ in range(400)] != readings
    level = first.response(2, first.gaps(*place)[2])
    assert np.std([row[2] for row in readings]) == pytest.approx(12 + 0.02 * level, rel=0.15)


def gaps_in_arrays(
    model: Model, scene: Surroundings, x: float, y: float, heading: float
) -> np.ndarray:
    """Effective gaps by all forty rays of the scene, as the module's text has them."""
    fan = np.array([-30.0, -15.0, 0.0, 15.0, 30.0])
    angles = heading + np.array(model.sensor_directions)[:, None] + np.radians(fan)
    bearings = heading + np.array(model.sensor_bearings)
    feet = np.array([x, y]) + model.radius * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=2).reshape(-1, 2)
    distances, grey = scene.cast(np.repeat(feet, 5, axis=0), rays)
    reach = model.proximity.gaps[-1]
    dim = 0.5 * (1.0 - grey) * np.maximum(reach - distances, 0.0)
    gaps = (distances + dim).reshape(8, 5) + 7.2e-6 * fan**2
    aside = np.array(model.sensor_directions) - np.array(model.sensor_bearings)
    nearest = gaps.min(axis=1)
    found: np.ndarray = nearest - model.radius * (1.0 - np.cos(aside))
    return found


@pytest.mark.parametrize("model", [KHEPERA, KHEPERA2])
def test_gaps_are_those_of_all_rays(model: Model) -> None:
    """A few rays in plain numbers see what forty in arrays see, black before white as well."""
    plan = FloorPlan(
        arena(
            wall=[
                {"points": [[0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]], "colour": [0.9, 0.9, 0.9]},
                {"points": [[0.16, -0.2], [0.16, 0.0]], "thickness": 0.004, "colour": [0, 0, 0]},
            ],
            cylinder=[{"centre": [0.0, -0.1], "radius": 0.01, "colour": [0.2, 0.2, 0.2]}],
        )
    )
    movers: list[Footprint] = [
        Disc(0.0, 0.0, 0.02, 0.4),
        Brick(-0.1, -0.05, 0.3, (0.05, 0.02), 1.0),
    ]
    scene = Surroundings(plan, movers)
    infrared = Infrared(model, scene, (), np.random.default_rng(0))
    reach = model.proximity.gaps[-1]
    seen = 0
    # bodies that reach into solids by half a millimetre count, too
    rng = np.random.default_rng(1)
    for x, y, heading in rng.uniform([-0.25, -0.25, -4.0], [0.25, 0.25, 4.0], (600, 3)).tolist():
        if scene.clearance(x, y) < model.radius - 0.0005:
            continue
        expected = gaps_in_arrays(model, scene, x, y, heading)
        limited = np.where(expected < reach, expected, inf).tolist()
        found = list(infrared.gaps(x, y, heading))
        assert found == pytest.approx(limited, abs=1e-9)
        seen += sum(gap < reach for gap in found)
    assert seen > 400


def test_black_is_seen_from_half_as_far() -> None:
    def front(colour: tuple[float, float, float]) -> float:
        infrared = ring(KHEPERA, wall=[{"points": [[0.1, -1], [0.1, 1]], "colour": colour}])
        return infrared.gaps(0.05, 0.0, 0.0)[2]

    white, black = front((1, 1, 1)), front((0, 0, 0))
    assert black - white == pytest.approx(0.5 * (0.043 - white), rel=0.05)


def test_a_wall_on_the_left_is_read_by_the_left_sensors() -> None:
    # beside the wall, facing along it
    infrared = ring(KHEPERA, wall=[{"points": [[-1.0, 0.05], [1.0, 0.05]]}])
    readings = infrared.proximity(0.0, 0.05 - 0.005 - 0.02 - KHEPERA.radius, 0.0)
    assert readings[0] > 450
    assert max(readings[3:7]) <= 60


def test_darkness_reads_the_dark_level() -> None:
    readings = np.array([ring(KHEPERA).ambient(0.0, 0.0, 0.0) for _ in range(50)])
    assert readings.mean() == pytest.approx(490, abs=5)
    assert np.abs(readings - 490).max() <= 11


@pytest.mark.parametrize(("distance", "counts"), [(0.1, 100), (0.2, 250), (0.4, 375), (0.75, 425)])
def test_lamp_before_a_sensor_reads_as_in_the_manual(distance: float, counts: int) -> None:
    # straight before sensor 2, measured from the sensor
    model = replace(KHEPERA, sensor_directions=(0.0,) * 8, sensor_bearings=(0.0,) * 8)
    infrared = ring(model, lamp=[{"centre": [model.radius + distance, 0.0]}])
    readings = np.mean([infrared.ambient(0.0, 0.0, 0.0) for _ in range(100)], axis=0)
    assert readings[2] == pytest.approx(counts, abs=5)


def test_a_lamp_is_seen_on_its_side_only_and_not_through_walls() -> None:
    lamp = [{"centre": [0.15, 0.0]}]
    free = ring(KHEPERA, lamp=lamp).ambient(0.0, 0.0, 0.0)
    assert max(free[2:4]) < 300
    assert min(free[6:8]) > 470
    wall = [{"points": [[0.1, -1.0], [0.1, 1.0]]}]
    assert min(ring(KHEPERA, lamp=lamp, wall=wall).ambient(0.0, 0.0, 0.0)) > 470


def test_a_stronger_lamp_is_brighter() -> None:
    weak, strong = (
        ring(KHEPERA, lamp=[{"centre": [0.3, 0.0], "power": power}]).ambient(0.0, 0.0, 0.0)[2]
        for power in (1.0, 4.0)
    )
    assert strong < weak - 50
