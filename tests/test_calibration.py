"""Calibration finds what an emulated robot's encoders do not see."""

import re
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from math import inf, nan, pi
from pathlib import Path

import pytest
from as_type import not_none
from hypothesis import given
from hypothesis import strategies as st
from khepera_protocol.serial.units import PULSE, WHEEL_BASE
from khepera_protocol.zenoh.payloads import Pose, Reset

from macor_hil.errors import CalibrationError
from macor_hil.hardware.calibration.course import (
    Calibration,
    Move,
    Run,
    drive_all,
    drive_move,
    fit_wheels,
    moves,
)
from macor_hil.hardware.calibration.measuring import BenchRuler, Hands
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.hardware.odometry import Wheels, integrate
from macor_hil.hardware.profile import load_profile

FLOOR = """
version = 1
title = "A floor without end"
start = { x = 0.0, y = 0.0 }
free = { points = [[0.0, 0.0], [0.1, 0.0]], half_width = 0.1 }
"""


@pytest.fixture(scope="module")
def floor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("floor") / "floor.toml"
    path.write_text(FLOOR)
    return path


def calibrate(floor: Path, drift: str, seed: int, runs: int) -> tuple[Calibration, Wheels]:
    """The calibration of an emulated robot, and its true wheels."""
    with open_hardware(f"khepera://{floor}?seed={seed}&drift={drift}", baud=38400) as hardware:
        ruler = BenchRuler(not_none(hardware.bench))
        done = drive_all(Driver(hardware.robot), moves(0.5), runs, ruler.place, ruler.measure)
        found = fit_wheels(list(done), Wheels())
        hidden = not_none(hardware.bench).truth().drift
    true = Wheels(PULSE * hidden.left_scale, PULSE * hidden.right_scale, hidden.wheel_base)
    return found, true


def shares(found: Calibration, true: Wheels) -> tuple[float, float]:
    """Errors of ratio and base as shares of what was hidden."""
    ratio, base = true.right / true.left, true.base
    return (found.ratio - ratio) / (ratio - 1), (found.wheels.base - base) / (base - WHEEL_BASE)


@pytest.mark.parametrize("seed", [1, 4, 7])
def test_hidden_errors_are_found_to_within_a_tenth_of_their_size(floor: Path, seed: int) -> None:
    found, true = calibrate(floor, "scale=0.005,base=0.01", seed, runs=1)
    assert max(map(abs, shares(found, true))) < 0.1
    assert found.wheels.left == pytest.approx(true.left, rel=2e-4)
    assert found.after < found.before / 50


def test_they_are_found_although_the_wheels_slip(floor: Path) -> None:
    found, true = calibrate(floor, "default", 8, runs=5)
    assert max(map(abs, shares(found, true))) < 0.1
    assert found.ratio_error < 0.0005
    assert found.base_error < 0.0001


def test_a_robot_without_errors_keeps_its_wheels(floor: Path) -> None:
    found, _ = calibrate(floor, "none", 1, runs=1)
    assert found.ratio == pytest.approx(1.0, abs=2e-5)
    assert found.wheels.base == pytest.approx(WHEEL_BASE, rel=5e-4)


def test_ends_without_a_heading_will_do() -> None:
    true = Wheels(PULSE * 1.01, PULSE * 0.99, 0.0545)
    runs = []
    for move in moves(0.4):
        counters, total = [], [0.0, 0.0]
        for way, turn in move.legs:
            left, right = Wheels().counts(way, turn)
            total = [total[0] + left, total[1] + right]
            counters.append((round(total[0]), round(total[1])))
        end = where(counters, true)
        runs.append(Run(move.name, tuple(counters), (end.x, end.y, None)))
    found = fit_wheels(runs, Wheels())
    assert found.wheels.left == pytest.approx(true.left, rel=1e-4)
    assert found.wheels.right == pytest.approx(true.right, rel=1e-4)
    assert found.wheels.base == pytest.approx(true.base, rel=1e-3)


def ideal_runs(side: float, wheels: Wheels, times: int = 1) -> list[Run]:
    """Runs of a robot of these wheels that meets every target of nominal ones."""
    runs = []
    for move in moves(side):
        counters, total = [], [0.0, 0.0]
        for way, turn in move.legs:
            total = [t + c for t, c in zip(total, Wheels().counts(way, turn), strict=True)]
            counters.append((round(total[0]), round(total[1])))
        end = where(counters, wheels)
        runs.append(Run(move.name, tuple(counters), (end.x, end.y, end.heading)))
    return runs * times


def where(counters: list[tuple[int, int]], wheels: Wheels) -> Pose:
    pose, before = Pose(x=0.0, y=0.0, heading=0.0), (0, 0)
    for after in counters:
        pose, before = integrate(pose, before, after, wheels), after
    return pose


@pytest.mark.parametrize(
    ("wheels", "says"),
    [
        (Wheels(PULSE, PULSE, 0.0178), "base|no wheels"),
        (Wheels(PULSE * 1.5, PULSE * 1.5, WHEEL_BASE * 1.5), "left wheel"),
        (Wheels(PULSE, PULSE * 0.7, WHEEL_BASE), "right wheel|no wheels"),
    ],
)
def test_wheels_that_no_khepera_has_are_refused(wheels: Wheels, says: str) -> None:
    with pytest.raises(CalibrationError, match=says):
        fit_wheels(ideal_runs(0.5, wheels), Wheels())


coordinates = st.floats(-2.0, 2.0) | st.just(0.0)


@given(
    st.lists(
        st.tuples(coordinates, coordinates, st.none() | st.floats(-pi, pi)), min_size=5, max_size=5
    )
)
def test_a_fit_ends_with_possible_wheels_or_an_error_wherever_moves_ended(
    ends: Sequence[tuple[float, float, float | None]],
) -> None:
    runs = [replace(run, end=end) for run, end in zip(ideal_runs(0.5, Wheels()), ends, strict=True)]
    with suppress(CalibrationError):
        wheels = fit_wheels(runs, Wheels()).wheels
        assert wheels.left == pytest.approx(PULSE, rel=0.21)
        assert wheels.right == pytest.approx(PULSE, rel=0.21)
        assert wheels.base == pytest.approx(WHEEL_BASE, rel=0.21)


@pytest.mark.parametrize(
    ("end", "says"),
    [
        ((nan, 0.0, None), "finite"),
        ((0.5, inf, None), "finite"),
        ((0.5, 0.0, nan), "finite"),
        ((-0.5, 0.0, None), "1000 mm from where the move leads, 500 0"),
        ((0.5, 0.0, 4.0), "between -180 and 180"),
    ],
)
def test_ends_that_cannot_be_are_refused(end: tuple[float, float, float | None], says: str) -> None:
    with pytest.raises(CalibrationError, match=says):
        moves(0.5)[0].check_end(end)
    moves(0.5)[0].check_end((0.45, -0.05, None))


def test_a_robot_in_whose_way_something_is_says_so_and_stands() -> None:
    with open_hardware("khepera://open-box?seed=1", baud=38400) as hardware:
        not_none(hardware.bench).reset(Reset())
        with pytest.raises(CalibrationError, match=r"straight: leg 1 of 1 ended early.*free floor"):
            drive_move(Driver(hardware.robot), Move("straight", ((2.0, 0.0),)))
        hardware.robot.halt()
        assert abs(not_none(hardware.bench).truth().pose.x) < 0.5


def test_an_arena_without_room_for_the_course_says_so(tmp_path: Path) -> None:
    done = calibrate_by_command("--port", "khepera://corridor?seed=1", folder=tmp_path)
    assert done.returncode == 2
    assert re.search("needs more room|needs free floor", done.stderr)
    assert not (tmp_path / "robot.json").exists()


def test_the_default_course_has_room_where_it_is_driven(tmp_path: Path) -> None:
    done = calibrate_by_command("--runs", "1", "--baud", "38400", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    wheels = load_profile(tmp_path / "robot.json").wheels
    assert wheels.base == pytest.approx(WHEEL_BASE, rel=0.02)
    assert [path.name for path in tmp_path.iterdir()] == ["robot.json"]


def calibrate_by_command(*options: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "macor_hil.cli", "calibrate", "--profile", "robot.json"]
    return subprocess.run(
        [*command, *options], cwd=folder, capture_output=True, text=True, timeout=100, check=False
    )


def test_hands_ask_until_they_get_numbers() -> None:
    answers = iter(["", "here", "512, -30 90"])
    said: list[str] = []
    hands = Hands(said.append, lambda *_, **__: next(answers))
    hands.place(moves(0.5)[0], 0)
    assert hands.measure(moves(0.5)[0]) == pytest.approx((0.512, -0.030, pi / 2))
    assert any("numbers are needed" in line for line in said)


def test_the_command_writes_the_profile(floor: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "macor_hil.cli", "calibrate", "--runs", "1", "--baud", "38400"]
    command += ["--port", f"khepera://{floor}?seed=4&drift=scale=0.005,base=0.01"]
    command += ["--side", "0.3", "--profile", str(tmp_path / "robot.json")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    assert re.match(r"right wheel over left 1\.0069\d ± ", done.stdout)
    wheels = load_profile(tmp_path / "robot.json").wheels
    assert wheels.right / wheels.left == pytest.approx(1.00695, abs=2e-4)
