"""Odometry error of emulated robots against theory: tables and picture of docs/drift.md.

Every robot is driven over the serial protocol (J, C, K, H, G) in virtual time, as a physical one
would be: a UMBmark square (Borenstein and Feng 1996: side 1 m, five runs each way round), and
straight metres. Error: true pose minus the pose reckoned from the counters with nominal measures.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import cos, degrees, hypot, pi, sin, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from khepera_protocol.palette import SERIES, drawing_style
from khepera_protocol.serial.units import (
    ACCELERATION_UNIT,
    CONTROL_PERIOD,
    PULSE,
    SPEED_UNIT,
    WHEEL_BASE,
)
from khepera_protocol.zenoh.payloads import Pose, Reset, WheelDrift
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from numpy.typing import NDArray
from page import DOCS, PICTURES, table, write_part

from khepera_emulator.body.drift import PRESETS
from macor_hil.hardware.khepera import Khepera, open_port
from macor_hil.hardware.odometry import integrate

Array = NDArray[np.float64]
Counts = tuple[float, float]

_ARENA = """
version = 1
title = "A floor without end"
start = { x = 0.0, y = 0.0 }
free = { points = [[0.0, 0.0], [0.1, 0.0]], half_width = 0.1 }
"""

_ROBOTS = range(1, 9)
_RUNS = 5
_SPEED, _ACCELERATION = 20, 64
"""Profile in the units of J, the robot's own at power-on: 160 mm/s and 0.2 m/s2."""

_SIDE = 1.0 / PULSE
_CORNER = pi / 2 * WHEEL_BASE / 2 / PULSE
_SPOT_SLIP = 2.0
"""The factor by which a robot slips more that turns on the spot."""

_METRES = 4
_PAUSE = 0.1
"""Seconds between two questions whether a leg has been driven."""

_ORIGIN = Pose(x=0.0, y=0.0, heading=0.0)
_PAGE = DOCS / "drift.md"


@dataclass(frozen=True, slots=True)
class Errors:
    """Errors x, y (m) and heading (rad), each of shape (runs, legs, 3), and the robot's drift."""

    drift: WheelDrift
    cw: Array
    ccw: Array
    straight: Array


@dataclass(frozen=True, slots=True)
class Theory:
    """Expected error after each leg, shape (legs, 3), and its covariance from slip."""

    mean: Array
    covariance: Array


def main() -> None:
    """Drive all robots, write the tables, draw the picture."""
    with _floor() as arena:
        robots = {seed: _measure(arena, "default", seed) for seed in _ROBOTS}
        presets = {name: _measure(arena, name, 1) for name in PRESETS}
    write_part(_PAGE, "drawn", _drawn_table(robots))
    write_part(_PAGE, "square", _square_table(robots))
    write_part(_PAGE, "straight", _straight_table(robots))
    write_part(_PAGE, "agreement", _agreement(robots))
    write_part(_PAGE, "presets", _preset_table(presets))
    with drawing_style():
        _draw(robots)


@contextmanager
def _floor() -> Iterator[Path]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "floor.toml"
        path.write_text(_ARENA, "utf-8")
        yield path


def square(turn: int) -> list[Counts]:
    """Ways of the wheels, in counts, around the square; `turn` 1 is counter-clockwise."""
    return [(_SIDE, _SIDE), (-turn * _CORNER, turn * _CORNER)] * 4


def straight() -> list[Counts]:
    """Metre after metre straight on."""
    return [(_SIDE, _SIDE)] * _METRES


def _measure(arena: Path, preset: str, seed: int) -> Errors:
    with Khepera(open_port(f"khepera://{arena}?seed={seed}&drift={preset}", 38400)) as robot:
        robot.connect()
        ways = {"cw": square(-1), "ccw": square(1), "straight": straight()}
        errors = {
            # slip is drawn from the reset's seed: every run of every robot has its own
            name: np.array(
                [_run(robot, legs, 1000 * seed + 100 * number + run) for run in range(_RUNS)]
            )
            for number, (name, legs) in enumerate(ways.items())
        }
        return Errors(robot.port.emulator.truth().drift, **errors)


def _run(robot: Khepera, legs: list[Counts], seed: int) -> list[list[float]]:
    """Drive legs from the origin, slip from a seed; the error after each."""
    emulator: Any = robot.port.emulator
    emulator.reset(Reset(pose=_ORIGIN, seed=seed))
    robot.set_counters(0, 0)
    robot.set_profile((_SPEED, _ACCELERATION), (_SPEED, _ACCELERATION))
    pose, counters, target = _ORIGIN, (0, 0), np.zeros(2)
    errors = []
    for leg in legs:
        target += leg
        before, counters = counters, _go_to(robot, target)
        pose = integrate(pose, before, counters)
        true = emulator.truth().pose
        errors.append([true.x - pose.x, true.y - pose.y, _wrap(true.heading - pose.heading)])
    return errors


def _go_to(robot: Khepera, target: Array) -> tuple[int, int]:
    robot.go_to(round(target[0]), round(target[1]))
    while not all(wheel.reached for wheel in robot.status()):
        robot.port.timeout = _PAUSE
        robot.port.read()  # nothing comes: time passes
    return robot.counters()


def _wrap(angle: float) -> float:
    return (angle + pi) % (2 * pi) - pi


def theory(drift: WheelDrift, legs: list[Counts]) -> Theory:
    """Return the expected result: exact kinematics of the wheels, slip to first order."""
    counted, true = np.zeros(3), np.zeros(3)
    spread = np.zeros((3, 3))
    means, covariances = [], []
    for left, right in legs:
        ways = np.array([left, right]) * PULSE
        counted = _arc(counted, ways, WHEEL_BASE)
        before = true
        true = _arc(before, ways * (drift.left_scale, drift.right_scale), drift.wheel_base)
        spread = _carry(spread, before, true) + _slip(drift, ways, before[2])
        means.append(true - counted)
        covariances.append(spread)
    return Theory(np.array(means), np.array(covariances))


def _arc(pose: Array, ways: Array, base: float) -> Array:
    """Return the pose after both wheels went their ways, in metres, on one arc."""
    way, turn = ways.mean(), (ways[1] - ways[0]) / base
    chord = way * np.sinc(turn / 2 / pi)
    middle = pose[2] + turn / 2
    arrived: Array = pose + np.array([chord * cos(middle), chord * sin(middle), turn])
    return arrived


def _carry(spread: Array, before: Array, after: Array) -> Array:
    """Covariance of pose and heading, carried along a leg."""
    lever = np.eye(3)
    lever[0, 2], lever[1, 2] = before[1] - after[1], after[0] - before[0]
    carried: Array = lever @ spread @ lever.T
    return carried


def _slip(drift: WheelDrift, ways: Array, heading: float) -> Array:
    """Covariance that the slip of one leg adds, its wheels independent in every period.

    A wheel that goes d in a period adds a variance of (slip d)^2. On a straight leg of length D
    the variance q of the heading makes q D^2 / 3 across, and q D / 2 with the heading.
    """
    on_the_spot = ways[0] * ways[1] < 0.0
    sd = drift.slip * (_SPOT_SLIP if on_the_spot else 1.0)
    wheel = sd**2 * _square_sum(abs(ways[0]))
    q = 2 * wheel / drift.wheel_base**2
    along = wheel / 2
    if on_the_spot:
        return np.diag([along / 2, along / 2, q])
    way = ways.mean()
    local = np.array([[along, 0, 0], [0, q * way**2 / 3, q * way / 2], [0, q * way / 2, q]])
    c, s = cos(heading), sin(heading)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turned: Array = turn @ local @ turn.T
    return turned


def _square_sum(way: float) -> float:
    """Sum of the squared ways of all control periods of a trapezoidal drive, m^2."""
    top, acceleration = _SPEED * SPEED_UNIT, _ACCELERATION * ACCELERATION_UNIT
    peak = min(top, sqrt(acceleration * way))
    cruise = way - peak**2 / acceleration
    return CONTROL_PERIOD * (peak * cruise + 2 * peak**3 / (3 * acceleration))


def _drawn_table(robots: dict[int, Errors]) -> str:
    head = ["robot (seed)", "left wheel, %", "right wheel, %", "base, mm"]
    rows = [
        [
            str(seed),
            f"{100 * (errors.drift.left_scale - 1):+.2f}",
            f"{100 * (errors.drift.right_scale - 1):+.2f}",
            f"{1000 * errors.drift.wheel_base:.2f}",
        ]
        for seed, errors in robots.items()
    ]
    return table(head, rows)


def _square_table(robots: dict[int, Errors]) -> str:
    head = ["robot", "way", "centre, theory (mm)", "centre, measured (mm)"]
    head += ["spread, theory (mm)", "spread, measured (mm)", "turned, theory", "turned, measured"]
    rows = []
    for seed, errors in robots.items():
        for name, turn in (("cw", -1), ("ccw", 1)):
            found, expected = getattr(errors, name)[:, -1], theory(errors.drift, square(turn))
            rows.append([str(seed), name, *_end(expected, found)])
    return table(head, rows)


def _end(expected: Theory, found: Array) -> list[str]:
    """Cells on the end of a way: theory and measurement side by side; found: (runs, 3)."""
    mean, spread = expected.mean[-1], expected.covariance[-1]
    return [
        _point(mean),
        _point(found.mean(axis=0)),
        f"{1000 * sqrt(spread[0, 0] + spread[1, 1]):.0f}",
        f"{1000 * sqrt(found[:, :2].var(axis=0, ddof=1).sum()):.0f}",
        f"{degrees(mean[2]):+.1f} deg",
        f"{degrees(found[:, 2].mean()):+.1f} deg",
    ]


def _point(error: Array) -> str:
    return f"{1000 * error[0]:+.0f}, {1000 * error[1]:+.0f}"


def _straight_table(robots: dict[int, Errors]) -> str:
    head = ["robot", "metres", "error, theory (mm)", "error, measured (mm)"]
    head += ["spread, theory (mm)", "spread, measured (mm)", "turned, theory", "turned, measured"]
    rows = []
    for seed, errors in robots.items():
        expected = theory(errors.drift, straight())
        for metres in (1, _METRES):
            part = Theory(expected.mean[:metres], expected.covariance[:metres])
            rows.append([str(seed), str(metres), *_end(part, errors.straight[:, metres - 1])])
    return table(head, rows)


def _agreement(robots: dict[int, Errors]) -> str:
    """Return the distance of means from theory, in units of their scatter by slip."""
    head = ["way", "distance of the mean from theory", "spread, measured over theory"]
    rows = []
    for name, legs in (("cw", square(-1)), ("ccw", square(1)), ("straight", straight())):
        distances, ratios = [], []
        for errors in robots.values():
            expected, found = theory(errors.drift, legs), getattr(errors, name)[:, -1]
            away = found.mean(axis=0) - expected.mean[-1]
            spread = expected.covariance[-1]
            distances.append(away @ np.linalg.solve(spread / _RUNS, away) / 3)
            ratios.append(found.var(axis=0, ddof=1)[:2].sum() / np.trace(spread[:2, :2]))
        rows.append([name, f"{sqrt(np.mean(distances)):.2f}", f"{sqrt(np.mean(ratios)):.2f}"])
    return table(head, rows)


def _preset_table(presets: dict[str, Errors]) -> str:
    head = ["`--drift`", "scale", "base", "slip", "square: E (mm)", "theory"]
    head += ["straight metre (mm)", "theory"]
    rows = []
    for name, errors in presets.items():
        settings = PRESETS[name]
        ends = [theory(errors.drift, square(turn)).mean[-1] for turn in (-1, 1)]
        metre = theory(errors.drift, straight()).mean[0]
        rows.append(
            [
                name,
                *(f"{100 * value:g} %" for value in (settings.scale, settings.base, settings.slip)),
                f"{_systematic(errors.cw[:, -1].mean(axis=0), errors.ccw[:, -1].mean(axis=0)):.1f}",
                f"{_systematic(*ends):.1f}",
                f"{1000 * hypot(*errors.straight[:, 0].mean(axis=0)[:2]):.1f}",
                f"{1000 * hypot(*metre[:2]):.1f}",
            ]
        )
    return table(head, rows)


def _systematic(cw: Array, ccw: Array) -> float:
    """UMBmark's figure in mm: the farther of the two centres from no error at all."""
    return 1000 * max(hypot(*cw[:2]), hypot(*ccw[:2]))


def _draw(robots: dict[int, Errors]) -> None:
    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    # more robots than colours: the second half is drawn broken
    looks = [(colour, dash) for dash in ("-", "--") for colour in SERIES]
    for (seed, errors), (colour, dash) in zip(robots.items(), looks, strict=False):
        for name, turn, mark in (("cw", -1, "o"), ("ccw", 1, "^")):
            _draw_ends(left, errors.drift, getattr(errors, name)[:, -1], turn, mark, colour)
        _draw_straight(right, errors, f"robot {seed}", colour, dash)
    left.set(xlabel="error in x, mm", ylabel="error in y, mm", title="after the square")
    left.set_aspect("equal")
    right.set(xlabel="straight on, m", ylabel="error across, mm", title="straight on")
    for panel in (left, right):
        panel.grid()
    figure.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.savefig(PICTURES / "drift-umbmark.png")


def _draw_ends(
    axes: Any, drift: WheelDrift, ends: Array, turn: int, mark: str, colour: str
) -> None:
    expected = theory(drift, square(turn))
    mean, spread = 1000 * expected.mean[-1], 1e6 * expected.covariance[-1][:2, :2]
    axes.plot(*(1000 * ends[:, :2].T), mark, color=colour, markersize=5, alpha=0.7)
    axes.plot(*mean[:2], "+", color=colour, markersize=9)
    sizes, turns = np.linalg.eigh(spread)
    axes.add_patch(
        Ellipse(
            (float(mean[0]), float(mean[1])),
            *(4 * np.sqrt(sizes)),
            angle=degrees(np.arctan2(turns[1, 0], turns[0, 0])),
            fill=False,
            edgecolor=colour,
            alpha=0.6,
        )
    )


def _draw_straight(axes: Any, errors: Errors, label: str, colour: str, dash: str) -> None:
    expected = theory(errors.drift, straight())
    metres = np.arange(1, _METRES + 1)
    mean, sd = 1000 * expected.mean[:, 1], 1000 * np.sqrt(expected.covariance[:, 1, 1])
    axes.plot([0, *metres], [0, *mean], color=colour, linestyle=dash, label=label)
    axes.fill_between(metres, mean - 2 * sd, mean + 2 * sd, color=colour, alpha=0.08)
    for run in errors.straight:
        axes.plot(metres, 1000 * run[:, 1], ".", color=colour, markersize=4)


if __name__ == "__main__":
    main()
