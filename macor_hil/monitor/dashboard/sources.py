"""Sources of what the dashboard shows: live robots, or a recording to scrub through."""

from typing import Final, NamedTuple, Protocol

from macor_hil.monitor.dashboard.board import Board, Parts
from macor_hil.monitor.dashboard.playing import RecordingSource
from macor_hil.monitor.follower import Follower
from macor_hil.monitor.robot_state import RobotState
from macor_hil.monitor.roster import Roster

_BUSY: Final = 0.05
"""Seconds that taking in may take at once: the pages are served by the same thread."""

_LOOKED_AT: Final = 20
"""Polls without a look after which a robot's own camera is left alone again."""

_NOBODY: Final = "khepera"
"""Name on the page while there is no robot."""


class Shown(NamedTuple):
    """A robot's page at a moment: its parts, and its latest picture."""

    parts: Parts
    picture: bytes


class Live:
    """Live robots, as followers know them, with a board for each.

    Args:
        roster: the robots.
    """

    def __init__(self, roster: Roster) -> None:
        self._roster = roster
        self._boards: dict[str, Board] = {}
        self._shown: dict[str, Shown] = {}
        self._looked: dict[str, int] = {}
        self._turn = 0

    def poll(self) -> None:
        """Take in what has come; called again and again, whether anyone looks or not."""
        self._roster.drain(_BUSY)
        self._turn += 1
        self._shown.clear()
        for name, follower in self._roster.robots.items():
            follower.feed.look(self._turn - self._looked.get(name, -_LOOKED_AT) < _LOOKED_AT)

    def choose(self, name: str) -> str:
        """Return a robot's name if it is known, else that of one who is there."""
        robots = self._roster.robots
        if name in robots:
            return name
        there = (each for each, follower in robots.items() if follower.watched.alive)
        return next(there, next(iter(robots), ""))

    def show(self, name: str) -> Shown:
        """Return a robot's page as of the last poll; computed once for all who look."""
        known = self._shown.get(name)
        if known is None:
            self._looked[name] = self._turn
            robots = {each: follower.watched for each, follower in self._roster.robots.items()}
            watched = robots.get(name) or RobotState(_NOBODY)
            board = self._boards.setdefault(name, Board())
            parts = board.parts(watched, robots, self._now())
            known = self._shown[name] = Shown(parts, board.picture)
        return known

    def _now(self) -> float:
        follower: Follower | None = next(iter(self._roster.robots.values()), None)
        return follower.now if follower else 0.0


class View(Protocol):
    """Something that one browser looks at."""

    robot: str

    def show(self) -> Shown:
        """Return the page as of now."""
        ...


class LiveView:
    """One browser's look at live robots.

    Attributes:
        robot: the one that was chosen; empty: none is there.
    """

    def __init__(self, live: Live, robot: str) -> None:
        self.robot = robot
        self._live = live

    def show(self) -> Shown:
        """Return the page as of now."""
        self.robot = self._live.choose(self.robot)
        return self._live.show(self.robot)


class RecordingView:
    """One browser's look at a recording, which it plays for itself.

    Attributes:
        robot: that was recorded.
        player: plays it.
    """

    def __init__(self, player: RecordingSource) -> None:
        self.player = player
        self.robot = player.watched.robot
        self._board = Board()

    def show(self) -> Shown:
        """Let time pass, and return the page as of now."""
        player = self.player
        player.poll()
        parts = self._board.parts(player.watched, {self.robot: player.watched}, player.now)
        parts["player"] = {
            "position": round(player.position, 2),
            "duration": round(player.duration, 2),
            "playing": player.playing,
            "speed": player.speed,
        }
        parts["moments"] = player.moments
        return Shown(parts, self._board.picture)
