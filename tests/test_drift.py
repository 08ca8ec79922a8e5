"""Drift: the pose shows it, the counters do not."""

from collections.abc import Iterator
from math import cos, pi, sin

import numpy as np
import pytest
from khepera_protocol.serial.units import PULSE
from khepera_protocol.zenoh.payloads import Pose, WheelDrift

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.body.chassis import Chassis
from khepera_emulator.body.drift import (
    PRESETS,
    DriftSettings,
    draw_drift,
    parse_drift,
    slip_sequence,
)
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import KHEPERA
from khepera_emulator.robot.khepera.robot import Robot
from khepera_emulator.world.world import World

ORIGIN = Pose(x=0.0, y=0.0, heading=0.0)


@pytest.fixture(scope="module")
def plain() -> Iterator[World]:
    arena = {
        "version": 1,
        "title": "nothing",
        "start": {"x": 0, "y": 0},
        "free": {"points": [[0, 0], [1, 0]], "half_width": 0.1},
    }
    world = World(Arena.model_validate(arena))
    yield world
    world.close()


def robot(world: World, drift: DriftSettings, seed: int = 1) -> Robot:
    rng = np.random.default_rng(seed)
    return Robot(world, KHEPERA, ORIGIN, draw_drift(drift, KHEPERA.wheel_base, rng), rng)


def drive(driven: Robot, left: int, right: int, ticks: int) -> tuple[int, int]:
    for wheel, speed in zip(driven.wheels, (left, right), strict=True):
        wheel.drive_speed(speed)
    for _ in range(ticks):
        driven.tick()
    return driven.wheels[0].counter, driven.wheels[1].counter


def test_unequal_wheels_bend_the_way_as_theory_says(plain: World) -> None:
    drift = WheelDrift(left_scale=0.995, right_scale=1.005, wheel_base=0.053, slip=0.0)
    chassis = Chassis(plain, KHEPERA, drift, ORIGIN)
    for _ in range(1000):
        chassis.roll((0.001, 0.001), (0.0, 0.0))
    turn = 0.010 * 1.0 / 0.053
    assert chassis.heading == pytest.approx(turn, rel=1e-9)
    assert chassis.x == pytest.approx(sin(turn) / turn, rel=1e-9)
    assert chassis.y == pytest.approx((1 - cos(turn)) / turn, rel=1e-9)


def test_a_wrong_base_shortens_the_turn(plain: World) -> None:
    drift = WheelDrift(left_scale=1.0, right_scale=1.0, wheel_base=0.053 * 1.02, slip=0.0)
    chassis = Chassis(plain, KHEPERA, drift, ORIGIN)
    for _ in range(100):
        chassis.roll((-0.000265 * pi, 0.000265 * pi), (0.0, 0.0))
    assert chassis.heading == pytest.approx(pi / 1.02, rel=1e-9)
    assert (chassis.x, chassis.y) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_counters_do_not_see_drift(plain: World) -> None:
    ideal, drifting = robot(plain, PRESETS["none"]), robot(plain, PRESETS["strong"])
    assert drive(ideal, 10, 8, 200) == drive(drifting, 10, 8, 200)
    assert ideal.chassis.heading != pytest.approx(drifting.chassis.heading, abs=1e-3)


def test_without_drift_odometry_is_the_truth(plain: World) -> None:
    driven = robot(plain, PRESETS["none"])
    left, right = drive(driven, 10, 8, 200)
    assert driven.chassis.heading == pytest.approx((right - left) * PULSE / 0.053, abs=2e-3)


def test_slip_is_seeded_and_averages_out(plain: World) -> None:
    settings = DriftSettings(slip=0.05)
    first, same, other = (robot(plain, settings, seed) for seed in (1, 1, 2))
    for driven in (first, same, other):
        drive(driven, 10, 10, 1000)
    assert first.chassis.pose == same.chassis.pose
    assert first.chassis.pose != other.chassis.pose
    assert first.chassis.pose.x == pytest.approx(0.8, rel=0.01)


def test_turning_on_the_spot_slips_more(plain: World) -> None:
    def spread(left: int, right: int) -> float:
        headings = []
        for seed in range(30):
            driven = robot(plain, DriftSettings(slip=0.1), seed)
            drive(driven, left, right, 50)
            headings.append(driven.chassis.heading)
        return float(np.std(headings))

    # straight on and on the spot the two wheels' errors add up alike, but for the factor of two
    assert spread(-10, 10) / spread(10, 10) == pytest.approx(2.0, rel=0.1)


def test_drawn_errors_have_the_given_spread() -> None:
    rng = np.random.default_rng(0)
    drawn = [draw_drift(DriftSettings(scale=0.005, base=0.01), 0.053, rng) for _ in range(2000)]
    assert np.std([drift.left_scale for drift in drawn]) == pytest.approx(0.005, rel=0.1)
    assert np.std([drift.right_scale for drift in drawn]) == pytest.approx(0.005, rel=0.1)
    assert np.std([drift.wheel_base for drift in drawn]) == pytest.approx(0.00053, rel=0.1)
    assert np.mean([drift.left_scale for drift in drawn]) == pytest.approx(1.0, abs=0.001)


def test_slip_sequence_does_not_depend_on_its_blocks() -> None:
    pairs = [slip_sequence(np.random.default_rng(3), block) for block in (2, 7)]
    for _ in range(20):
        assert next(pairs[0]) == next(pairs[1])


@pytest.mark.parametrize(
    ("text", "settings"),
    [
        ("none", DriftSettings()),
        ("default", PRESETS["default"]),
        ("scale=0.01,slip=0.05", DriftSettings(scale=0.01, slip=0.05)),
        ("base=0", DriftSettings()),
    ],
)
def test_drift_option(text: str, settings: DriftSettings) -> None:
    assert parse_drift(text) == settings


@pytest.mark.parametrize(
    "text", ["", "weak", "scale", "scale=", "scale=x", "scale=-0.1", "slip=0.5", "slip=nan", "a=1"]
)
def test_unreadable_drift_option(text: str) -> None:
    with pytest.raises(EmulatorError, match="cannot read the drift") as caught:
        parse_drift(text)
    assert repr(text) in str(caught.value)
