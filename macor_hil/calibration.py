"""What the wheels' counts mean: drive marked moves, measure where they ended, fit the wheels.

The moves are a straight line, UMBmark's square (Borenstein and Feng 1996) clockwise and
counter-clockwise, and turns on the spot, several times each. A straight line tells the way of a
count, its bend the ratio of the wheels, corners and turns the base. All ends together are fitted
by least squares to the counter readings after every leg: the result does not depend on how well
the robot met its targets. What scatters more from run to run counts less.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import cos, pi, sin
from typing import Final

import numpy as np
from numpy.typing import NDArray

from macor_hil.drive import DriveSettings
from macor_hil.errors import RobotError
from macor_hil.odometry import Wheels, integrate
from macor_hil.robot import Khepera
from protocol.side_channel import Pose

Array = NDArray[np.float64]
Counters = tuple[int, int]

_POLL: Final = 0.1
_LONGEST: Final = 60.0
"""Seconds that a leg may take."""

_TURNS: Final = 5
"""Turns on the spot: a base that is 8 % wrong still shows as less than half a turn."""

_FLOOR: Final = 0.0003
"""Metres by which a run scatters at least: a count or two."""

_STEP: Final = 1e-6
_SMALL: Final = 1e-8
_WEIGHINGS: Final = 4
_ORIGIN: Final = Pose(x=0.0, y=0.0, heading=0.0)


@dataclass(frozen=True, slots=True)
class Move:
    """Legs that are driven one after the other: each a way in metres and a turn in radians."""

    name: str
    legs: tuple[tuple[float, float], ...]


def moves(side: float) -> tuple[Move, ...]:
    """A straight line and both squares, of a side in metres, and turns both ways round."""
    ways = (("clockwise", -1), ("counter-clockwise", 1))
    squares = [Move(f"square {n}", ((side, 0.0), (0.0, s * pi / 2)) * 4) for n, s in ways]
    turns = [Move(f"{_TURNS} turns {n}", ((0.0, s * _TURNS * 2 * pi),)) for n, s in ways]
    return (Move("straight", ((side, 0.0),)), *squares, *turns)


@dataclass(frozen=True, slots=True)
class Run:
    """One drive of a move.

    Attributes:
        move: which.
        counters: after each leg, from (0, 0).
        end: where the robot ended, seen from where it began: x ahead and y to the left in metres;
            heading in radians, None if it was not measured.
    """

    move: str
    counters: tuple[Counters, ...]
    end: tuple[float, float, float | None]


@dataclass(frozen=True, slots=True)
class Calibration:
    """What was found.

    Attributes:
        wheels: what counts mean.
        ratio: way of the right wheel's count over that of the left one.
        ratio_error, base_error: standard errors, from how far the runs differ; base in metres.
        before, after: how far ends lie from where odometry takes them to be, metres, root mean
            square, with the wheels assumed at first and with those found.
    """

    wheels: Wheels
    ratio: float
    ratio_error: float
    base_error: float
    before: float
    after: float


def drive_move(robot: Khepera, move: Move, settings: DriveSettings) -> tuple[Counters, ...]:
    """Drive a move from where the robot stands; counters after each leg.

    Raises:
        RobotError: the robot does not answer, or does not get to the end of a leg.
    """
    robot.stop()
    robot.set_counters(0, 0)
    profile = settings.speed, settings.acceleration
    robot.set_profile(profile, profile)
    target = np.zeros(2)
    reached = []
    for way, turn in move.legs:
        target += settings.wheels.counts(way, turn)
        robot.go_to(round(target[0]), round(target[1]))
        end = robot.clock() + _LONGEST
        while not all(wheel.reached for wheel in robot.status()):
            if robot.clock() > end:
                raise RobotError(f"the leg of {way:g} m was not driven in {_LONGEST:.0f} s")
            robot.wait(_POLL)
        reached.append(robot.counters())
    return tuple(reached)


def seen_from(start: Pose, end: Pose) -> tuple[float, float, float]:
    """A pose as seen from another one: ahead, to the left, turned."""
    dx, dy = end.x - start.x, end.y - start.y
    c, s = cos(start.heading), sin(start.heading)
    return c * dx + s * dy, c * dy - s * dx, end.heading - start.heading


Measure = Callable[[Move], tuple[float, float, float | None]]
"""Where a robot ended that has driven a move, seen from where it began."""


def drive_all(
    robot: Khepera,
    plan: Sequence[Move],
    runs: int,
    settings: DriveSettings,
    place: Callable[[Move, int], None],
    measure: Measure,
) -> Iterator[Run]:
    """Drive every move so many times.

    Args:
        robot: the robot.
        plan: the moves.
        runs: how often each is driven.
        settings: how.
        place: puts the robot on its mark before a run of a number.
        measure: tells where it ended.

    Raises:
        RobotError: the robot does not answer.
    """
    for number in range(runs):
        for move in plan:
            place(move, number)
            yield Run(move.name, drive_move(robot, move, settings), measure(move))


def fit_wheels(runs: Sequence[Run], assumed: Wheels) -> Calibration:
    """The wheels that explain where the runs ended.

    Args:
        runs: at least one of every move.
        assumed: where the search begins.
    """
    lever = max(abs(run.end[0]) + abs(run.end[1]) for run in runs) or 1.0
    weights = np.ones(len(_residuals(runs, assumed, lever)))
    for _ in range(_WEIGHINGS):
        found, rest, slopes = _least_squares(runs, assumed, lever, weights)
        weights = _weights(runs, rest / weights)
    free = max(1, len(rest) - 3)
    covariance = np.linalg.pinv(slopes.T @ slopes) * float(rest @ rest) / free
    wheels = _scaled(assumed, found)
    ratio = wheels.right / wheels.left
    across = np.array([-1.0, 1.0, 0.0])
    return Calibration(
        wheels,
        ratio,
        ratio_error=float(np.sqrt(across @ covariance @ across)) * ratio,
        base_error=float(np.sqrt(covariance[2, 2])) * assumed.base,
        before=_apart(runs, assumed),
        after=_apart(runs, wheels),
    )


def _least_squares(
    runs: Sequence[Run], assumed: Wheels, lever: float, weights: Array
) -> tuple[Array, Array, Array]:
    """Factors of left, right and base (Gauss-Newton); weighted residuals, and their slopes."""
    found = np.ones(3)
    while True:
        rest = weights * _residuals(runs, _scaled(assumed, found), lever)
        slopes = np.empty((len(rest), 3))
        for k in range(3):
            moved = found.copy()
            moved[k] += _STEP
            there = weights * _residuals(runs, _scaled(assumed, moved), lever)
            slopes[:, k] = (there - rest) / _STEP
        step = np.linalg.lstsq(slopes, -rest, rcond=None)[0]
        found = found + step
        if np.abs(step).max() < _SMALL:
            return found, rest, slopes


def _weights(runs: Sequence[Run], rest: Array) -> Array:
    """One over the scatter of the same residual of the same move, from run to run."""
    kinds = [(run.move, part) for run in runs for part in range(2 if run.end[2] is None else 3)]
    squares: dict[tuple[str, int], list[float]] = {}
    for kind, value in zip(kinds, rest, strict=True):
        squares.setdefault(kind, []).append(float(value) ** 2)
    scatter = {kind: np.sqrt(np.mean(all_) + _FLOOR**2) for kind, all_ in squares.items()}
    return np.array([1.0 / scatter[kind] for kind in kinds])


def _scaled(wheels: Wheels, factors: Array) -> Wheels:
    left, right, base = (float(factor) for factor in factors)
    return Wheels(wheels.left * left, wheels.right * right, wheels.base * base)


def _reckoned(run: Run, wheels: Wheels) -> Pose:
    pose, before = _ORIGIN, (0, 0)
    for counters in run.counters:
        pose = integrate(pose, before, counters, wheels)
        before = counters
    return pose


def _residuals(runs: Sequence[Run], wheels: Wheels, lever: float) -> Array:
    """Errors of all ends in metres; those of headings as they show at the lever's end."""
    errors = []
    for run in runs:
        pose = _reckoned(run, wheels)
        x, y, heading = run.end
        errors += [pose.x - x, pose.y - y]
        if heading is not None:
            errors.append(lever * _wrap(pose.heading - heading))
    return np.array(errors)


def _apart(runs: Sequence[Run], wheels: Wheels) -> float:
    """Distance of ends from where odometry takes them to be, metres, root mean square."""
    squares = []
    for run in runs:
        pose = _reckoned(run, wheels)
        squares.append((pose.x - run.end[0]) ** 2 + (pose.y - run.end[1]) ** 2)
    return float(np.sqrt(np.mean(squares)))


def _wrap(angle: float) -> float:
    return (angle + pi) % (2 * pi) - pi
