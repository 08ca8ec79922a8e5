"""Scores of robots by their ground truth, whoever drives them: way, collisions, time, the goal.

A score is of an attempt: it begins where a robot is put down, counts time from its first motion,
and ends at the goal, if there is one. Whoever is put elsewhere begins the next one.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import hypot, inf
from typing import Final

from khepera_protocol.text import in_order, printable
from khepera_protocol.zenoh.payloads import Pose, Truth
from rich.table import Table

MOST_ROBOTS: Final = 200
"""Robots that are scored at most, whatever comes."""

_FASTEST: Final = 1.1
"""m/s that no robot exceeds: it was put elsewhere."""

_JUMP: Final = 0.05
_MOVES: Final = 0.004
"""m/s of a wheel from which on a robot has set out: half a unit of its speed controller."""

_APART: Final = 0.5
"""Seconds without touching anything after which a touch is another collision."""

_NAME: Final = 32


@dataclass(frozen=True, slots=True)
class Finish:
    """A goal: a circle that the middle of a robot has to enter; metres."""

    x: float
    y: float
    radius: float

    def holds(self, pose: Pose) -> bool:
        """Return whether a robot is in it."""
        return hypot(pose.x - self.x, pose.y - self.y) <= self.radius


@dataclass
class Score:
    """The score of a robot in its present attempt.

    Attributes:
        attempts: how often it has set out.
        collisions: touches, each apart from the one before.
        way: metres driven.
        time: seconds of the robot's time since it set out, up to the goal.
        finished: whether it has come to the goal.
        best: seconds of its fastest attempt that came to the goal; infinite: none did.
    """

    attempts: int = 0
    collisions: int = 0
    way: float = 0.0
    time: float = 0.0
    finished: bool = False
    best: float = inf
    _last: Truth | None = field(default=None, repr=False)
    _set_out: float | None = field(default=None, repr=False)
    _touched_at: float = field(default=-inf, repr=False)

    def add(self, truth: Truth, finish: Finish | None = None) -> None:
        """Take in where the robot is now; what is older than the last is left out."""
        last = self._last
        if last is not None and truth.time <= last.time:
            if truth.time == last.time:
                return
            last = None  # a robot that was switched on again
        if last is None or _was_put(last, truth):
            self._begin(truth)
            return
        self._last = truth
        if self.finished:
            return
        if self._set_out is None:
            if max(map(abs, truth.speed)) < _MOVES:
                return
            self._set_out = last.time
            self.attempts += 1
        self.way += _way(last, truth)
        self.time = truth.time - self._set_out
        self._count_touch(last, truth)
        if finish is not None and finish.holds(truth.pose):
            self.finished = True
            self.best = min(self.best, self.time)

    def _begin(self, truth: Truth) -> None:
        self.collisions, self.way, self.time, self.finished = 0, 0.0, 0.0, False
        self._last = truth
        self._set_out, self._touched_at = None, -inf

    def _count_touch(self, last: Truth, truth: Truth) -> None:
        # between two looks it may have touched something that it has left again
        if not truth.contact and truth.touched == last.touched:
            return
        if truth.time - self._touched_at > _APART:
            self.collisions += 1
        self._touched_at = truth.time


class Scoreboard:
    """Scores of all robots that are seen.

    Args:
        finish: goal of all of them; None: there is none.

    Attributes:
        scores: of each robot by its name.
    """

    def __init__(self, finish: Finish | None = None) -> None:
        self.scores: dict[str, Score] = {}
        self._finish = finish

    def add(self, robot: str, truth: Truth) -> None:
        """Take in where a robot is now."""
        if robot in self.scores or len(self.scores) < MOST_ROBOTS:
            self.scores.setdefault(robot, Score()).add(truth, self._finish)

    def ranking(self) -> list[tuple[str, Score]]:
        """Return all scores, the best first: at the goal soonest, touched least, farthest."""

        def rank(named: tuple[str, Score]) -> tuple[float, int, float, str]:
            name, score = named
            return score.best, score.collisions, -score.way, in_order(name)

        return sorted(self.scores.items(), key=rank)


def drawn(ranking: Iterable[tuple[str, Score]], *, with_goal: bool) -> Table:
    """Return a table of scores for a terminal."""
    table = Table("", "robot", "attempts", "collisions", "way", "time")
    for column in table.columns[2:]:
        column.justify = "right"
    if with_goal:
        table.add_column("goal", justify="right")
    for place, (name, score) in enumerate(ranking, 1):
        cells = [
            *(str(place), printable(name, _NAME), str(score.attempts), str(score.collisions)),
            *(f"{score.way:.2f} m", f"{score.time:.1f} s"),
        ]
        if with_goal:
            cells.append("-" if score.best == inf else f"{score.best:.1f} s")
        table.add_row(*cells, style="bold" if score.finished else None)
    if not table.rows:
        table.caption = "no robot has been seen yet"
    return table


def _was_put(last: Truth, truth: Truth) -> bool:
    far = _way(last, truth) > _JUMP + _FASTEST * (truth.time - last.time)
    return far or (last.touched and not truth.touched)


def _way(one: Truth, other: Truth) -> float:
    return hypot(other.pose.x - one.pose.x, other.pose.y - one.pose.y)
