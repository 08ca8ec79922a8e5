"""Calibration of the wheels: drive marked moves, measure where they ended, fit the wheels.

The moves are a straight line, UMBmark's square (Borenstein and Feng 1996) clockwise and
counter-clockwise, and turns on the spot, several times each. A straight line tells the way of a
count, its bend the ratio of the wheels, corners and turns the base. All ends together are fitted
by least squares to the counter readings after every leg: the result does not depend on how well
the robot met its targets. What scatters more from run to run counts less.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import cos, hypot, isfinite, pi, sin
from typing import Final

import numpy as np
from khepera_protocol.zenoh.payloads import Pose
from numpy.typing import NDArray

from macor_hil.errors import CalibrationError
from macor_hil.hardware.driver import Driver
from macor_hil.hardware.odometry import Wheels, integrate

Array = NDArray[np.float64]
Counters = tuple[int, int]
End = tuple[float, float, float | None]
"""Metres ahead of the mark and to the left of it; radians turned to the left, if measured."""

_TURNS: Final = 5
"""Turns on the spot: a base that is 8 % wrong still shows as less than half a turn."""

_FLOOR: Final = 0.0003
"""Metres by which a run scatters at least: a count or two."""

_POSSIBLE: Final = 0.2
"""Share by which wheels may differ from a Khepera's nominal ones: clients of real robots differ by
4 % on the way of a count and by 8 % on the base."""

_REST: Final = 0.05
"""Share of a straight line's length by which wheels may leave ends unexplained; slip of the wheels
leaves 1 to 2 %."""

_LEAST_REST: Final = 0.01
"""Metres by which they always may: what a hand with a ruler measures by."""

_LEAST_ROOM: Final = 0.05
"""Metres by which an end may always be beside where the move leads."""

_STEP: Final = 1e-6
_SMALL: Final = 1e-8
_MOST_STEPS: Final = 100
_WEIGHINGS: Final = 4
_ORIGIN: Final = Pose(x=0.0, y=0.0, heading=0.0)


@dataclass(frozen=True, slots=True)
class Move:
    """Legs that are driven one after the other: each a way in metres and a turn in radians."""

    name: str
    legs: tuple[tuple[float, float], ...]

    @property
    def places(self) -> tuple[Pose, ...]:
        """Places from the mark on: the beginning, and the end of every leg."""
        poses = [_ORIGIN]
        for way, turn in self.legs:
            x, y, heading = poses[-1].x, poses[-1].y, poses[-1].heading
            poses.append(
                Pose(x=x + way * cos(heading), y=y + way * sin(heading), heading=heading + turn)
            )
        return tuple(poses)

    def check_end(self, end: End) -> None:
        """Refuse an end that no robot of nearly these wheels can have come to.

        Raises:
            CalibrationError: it is no place, or far from where the move leads.
        """
        x, y, turn = end
        if not (isfinite(x) and isfinite(y) and isfinite(turn or 0.0)):
            raise CalibrationError("a place has finite numbers")
        there = self.places[-1]
        room = max(_LEAST_ROOM, max(abs(way) for way, _ in self.legs) / 2)
        apart = hypot(x - there.x, y - there.y)
        if apart > room:
            raise CalibrationError(
                f"that is {1000 * apart:.0f} mm from where the move leads,"
                f" {1000 * there.x:.0f} {1000 * there.y:.0f}, and {1000 * room:.0f} mm at most are"
                " possible; millimetres ahead of the mark, and to the left of it (right: negative)"
            )
        if abs(turn or 0.0) > pi:
            raise CalibrationError("a turn beyond whole moves is between -180 and 180 degrees")


def moves(side: float) -> tuple[Move, ...]:
    """Plan a straight line and both squares, of a side in metres, and turns both ways round."""
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
    end: End


@dataclass(frozen=True, slots=True)
class Calibration:
    """Result of a calibration.

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


def drive_move(driver: Driver, move: Move) -> tuple[Counters, ...]:
    """Drive a move from where the robot stands; counters after each leg.

    Raises:
        RobotError: the robot does not answer.
        CalibrationError: it touches something, or does not get to the end of a leg.
    """
    driver.start()
    reached = []
    for number, (way, turn) in enumerate(move.legs, 1):
        outcome = driver.leg(way, turn)
        if outcome.collided:
            raise CalibrationError(
                f"{move.name}: leg {number} of {len(move.legs)} ended early, at something in the"
                " way or at wheels that do not turn; the course needs free floor: another place,"
                " or a smaller --side"
            )
        reached.append(outcome.counters)
    return tuple(reached)


def seen_from(start: Pose, end: Pose) -> tuple[float, float, float]:
    """Return a pose as seen from another one: ahead, to the left, turned."""
    dx, dy = end.x - start.x, end.y - start.y
    c, s = cos(start.heading), sin(start.heading)
    return c * dx + s * dy, c * dy - s * dx, end.heading - start.heading


Measure = Callable[[Move], End]
"""Place where a robot ended that has driven a move, seen from where it began."""


def drive_all(
    driver: Driver,
    plan: Sequence[Move],
    runs: int,
    place: Callable[[Move, int], None],
    measure: Measure,
    done: int = 0,
) -> Iterator[Run]:
    """Drive every move so many times.

    Args:
        driver: of the robot.
        plan: the moves.
        runs: how often each is driven.
        place: puts the robot on its mark before a run of a number.
        measure: tells where it ended.
        done: moves that have been driven before.

    Raises:
        RobotError, CalibrationError: the robot does not answer, or cannot drive there.
    """
    for number in range(runs):
        for move in plan:
            done -= 1
            if done < 0:
                place(move, number)
                yield Run(move.name, drive_move(driver, move), measure(move))


def fit_wheels(runs: Sequence[Run], assumed: Wheels) -> Calibration:
    """Fit the wheels that explain where the runs ended.

    Args:
        runs: at least one of every move.
        assumed: where the search begins.

    Raises:
        CalibrationError: no wheels do, or none that a Khepera can have.
    """
    lever = max(abs(run.end[0]) + abs(run.end[1]) for run in runs) or 1.0
    weights = np.ones(len(_residuals(runs, assumed, lever)))
    for _ in range(_WEIGHINGS):
        found, rest, slopes = _least_squares(runs, assumed, lever, weights)
        weights = _weights(runs, rest / weights)
    free = max(1, len(rest) - 3)
    covariance = np.linalg.pinv(slopes.T @ slopes) * float(rest @ rest) / free
    wheels = _scaled(assumed, found)
    _check_possible(wheels)
    ratio = wheels.right / wheels.left
    across = np.array([-1.0, 1.0, 0.0])
    result = Calibration(
        wheels,
        ratio,
        ratio_error=float(np.sqrt(across @ covariance @ across)) * ratio,
        base_error=float(np.sqrt(covariance[2, 2])) * assumed.base,
        before=_apart(runs, assumed),
        after=_apart(runs, wheels),
    )
    if not result.after <= max(_LEAST_REST, _REST * lever):
        raise _unexplained(f"with the best ones odometry is {1000 * result.after:.0f} mm off; ")
    return result


def _least_squares(
    runs: Sequence[Run], assumed: Wheels, lever: float, weights: Array
) -> tuple[Array, Array, Array]:
    """Fit factors of left, right and base (Gauss-Newton); also weighted residuals and slopes."""
    found = np.ones(3)
    for _ in range(_MOST_STEPS):
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
        if not (found.min() > 0.1 and found.max() < 10.0):  # nor for what is not a number
            break
    raise _unexplained()


def _unexplained(how_far: str = "") -> CalibrationError:
    return CalibrationError(
        f"no wheels explain where the moves ended; {how_far}did the robot touch something, or was"
        " an end measured from another mark?"
    )


def _check_possible(wheels: Wheels) -> None:
    """Refuse wheels that no Khepera has.

    Raises:
        CalibrationError: they differ too much from the nominal ones.
    """
    nominal = Wheels()
    for what, found, usual in (
        ("the left wheel's way of a count is", wheels.left, nominal.left),
        ("the right wheel's way of a count is", wheels.right, nominal.right),
        ("the wheel base is", wheels.base, nominal.base),
    ):
        if not abs(found / usual - 1.0) <= _POSSIBLE:
            raise CalibrationError(
                f"the ends say that {what} {1000 * found:.4g} mm, where a Khepera has"
                f" {1000 * usual:.4g} mm; did the robot touch something, or was an end measured"
                " from another mark? Nothing was written"
            )


def _weights(runs: Sequence[Run], rest: Array) -> Array:
    """Return the reciprocal scatter of the same residual of the same move, from run to run."""
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
    """Return errors of all ends in metres; those of headings as they show at the lever's end."""
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
