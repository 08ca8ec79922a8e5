"""Follows a robot: its feed's events go into its state."""

import time
from collections.abc import Callable
from typing import Self

import zenoh
from khepera_protocol.zenoh.keys import CONTROLLER

from macor_hil.monitor.robot_state import RobotState
from macor_hil.telemetry.feed import Feed


class Follower:
    """A follower of one robot and its controller; use as a context.

    Args:
        session, robot, camera: see `Feed`.

    Attributes:
        watched: what is known.

    Raises:
        TelemetryError: the name cannot be part of a key.
    """

    def __init__(self, session: zenoh.Session, robot: str, *, camera: bool = False) -> None:
        self.watched = RobotState(robot)
        self.feed = Feed(session, robot, camera=camera)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.feed.__exit__()

    @property
    def introduced(self) -> bool:
        """True while a controller is there that has told its latest state and decision."""
        return self.watched.controlled.alive and self.feed.introduced(CONTROLLER)

    @property
    def now(self) -> float:
        """The time that ages count to, in seconds of the clock of the arrivals."""
        return self.feed.clock.seconds()

    def follow(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Take in what comes for a time, or until something is so."""
        end = time.monotonic() + seconds
        while not until() and (left := end - time.monotonic()) > 0.0:
            event = self.feed.get(left)
            if event is None:
                return
            self.watched.take(event)

    def drain(self, seconds: float) -> None:
        """Take in what has come, for so long at most, and wait for nothing."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and (event := self.feed.get(0.0)):
            self.watched.take(event)
