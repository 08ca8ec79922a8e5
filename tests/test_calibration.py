"""Calibration finds what an emulated robot's encoders do not see."""

import re
import subprocess
import sys
from math import pi

import pytest

from macor_hil.calibration import Run, drive_all, fit_wheels, moves
from macor_hil.drive import Driver
from macor_hil.hardware import open_hardware
from macor_hil.odometry import Wheels
from macor_hil.profile import load_profile
from macor_hil.rulers import BenchRuler, Hands
from protocol.units import PULSE, WHEEL_BASE

FLOOR = """
version = 1
title = "A floor without end"
start = { x = 0.0, y = 0.0 }
free = { points = [[0.0, 0.0], [0.1, 0.0]], half_width = 0.1 }
"""


@pytest.fixture(scope="module")
def floor(tmp_path_factory):
    path = tmp_path_factory.mktemp("floor") / "floor.toml"
    path.write_text(FLOOR)
    return path


def calibrate(floor, drift, seed, runs):
    """The calibration of an emulated robot, and its true wheels."""
    with open_hardware(f"khepera://{floor}?seed={seed}&drift={drift}", baud=38400) as hardware:
        ruler = BenchRuler(hardware.bench)
        done = drive_all(Driver(hardware.robot), moves(0.5), runs, ruler.place, ruler.measure)
        found = fit_wheels(list(done), Wheels())
        hidden = hardware.bench.truth().drift
    true = Wheels(PULSE * hidden.left_scale, PULSE * hidden.right_scale, hidden.wheel_base)
    return found, true


def shares(found, true):
    """Errors of ratio and base as shares of what was hidden."""
    ratio, base = true.right / true.left, true.base
    return (found.ratio - ratio) / (ratio - 1), (found.wheels.base - base) / (base - WHEEL_BASE)


@pytest.mark.parametrize("seed", [1, 4, 7])
def test_hidden_errors_are_found_to_within_a_tenth_of_their_size(floor, seed):
    found, true = calibrate(floor, "scale=0.005,base=0.01", seed, runs=1)
    assert max(map(abs, shares(found, true))) < 0.1
    assert found.wheels.left == pytest.approx(true.left, rel=2e-4)
    assert found.after < found.before / 50


def test_they_are_found_although_the_wheels_slip(floor):
    found, true = calibrate(floor, "default", 8, runs=5)
    assert max(map(abs, shares(found, true))) < 0.1
    assert found.ratio_error < 0.0005
    assert found.base_error < 0.0001


def test_a_robot_without_errors_keeps_its_wheels(floor):
    found, _ = calibrate(floor, "none", 1, runs=1)
    assert found.ratio == pytest.approx(1.0, abs=2e-5)
    assert found.wheels.base == pytest.approx(WHEEL_BASE, rel=5e-4)


def test_ends_without_a_heading_will_do():
    true = Wheels(PULSE * 1.01, PULSE * 0.99, 0.0545)
    runs = []
    for move in moves(0.4):
        counters, total = [], [0.0, 0.0]
        for way, turn in move.legs:
            left, right = Wheels().counts(way, turn)
            total = [total[0] + left, total[1] + right]
            counters.append((round(total[0]), round(total[1])))
        plain = Run(move.name, tuple(counters), (0.0, 0.0, None))
        from macor_hil.calibration import _reckoned

        end = _reckoned(plain, true)
        runs.append(Run(move.name, tuple(counters), (end.x, end.y, None)))
    found = fit_wheels(runs, Wheels())
    assert found.wheels.left == pytest.approx(true.left, rel=1e-4)
    assert found.wheels.right == pytest.approx(true.right, rel=1e-4)
    assert found.wheels.base == pytest.approx(true.base, rel=1e-3)


def test_hands_ask_until_they_get_numbers():
    answers = iter(["", "here", "512, -30 90"])
    said = []
    hands = Hands(said.append, lambda *_, **__: next(answers))
    hands.place(moves(0.5)[0], 0)
    assert hands.measure(moves(0.5)[0]) == pytest.approx((0.512, -0.030, pi / 2))
    assert any("numbers are needed" in line for line in said)


def test_the_command_writes_the_profile(floor, tmp_path):
    command = [sys.executable, "-m", "macor_hil.cli", "calibrate", "--runs", "1", "--baud", "38400"]
    command += ["--port", f"khepera://{floor}?seed=4&drift=scale=0.005,base=0.01"]
    command += ["--side", "0.3", "--profile", str(tmp_path / "robot.json")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    assert re.match(r"right wheel over left 1\.0069\d ± ", done.stdout)
    wheels = load_profile(tmp_path / "robot.json").wheels
    assert wheels.right / wheels.left == pytest.approx(1.00695, abs=2e-4)
