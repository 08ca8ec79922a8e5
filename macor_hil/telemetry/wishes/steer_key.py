"""The steer key `macor/<robot>/steer`: pauses a run that allows it, or changes planner and goal.

Wishes come in a thread of Zenoh. A pause stops the robot at once: the command that is driven is cut
short, and counts for nothing. A new course waits until that command has ended, and begins with a
new look.
"""

import threading
from collections.abc import Callable
from typing import Final

import zenoh
from khepera_protocol.zenoh.controller_payloads import Steer
from khepera_protocol.zenoh.keys import STEER
from khepera_protocol.zenoh.payload_model import PayloadError

from macor_hil.errors import TelemetryError
from macor_hil.telemetry.wishes.acting_key import ActingKey, ask_to_act

_LONGEST: Final = 1_000
"""Bytes of a wish at most."""

_LOOK: Final = 0.05
"""Seconds between two looks for a signal during a pause."""


class PausedError(Exception):
    """The robot is to stand, in the middle of a command."""


class Helm:
    """The wishes of those who may steer a run.

    Args:
        check: sees that a planner or goal can be had; raises MacorError where it cannot.
    """

    def __init__(self, check: Callable[[Steer], None]) -> None:
        self._check = check
        self._changed = threading.Condition()
        self._paused = False
        self._course: Steer | None = None

    @property
    def wants(self) -> bool:
        """True if the run is to pause or to change its course."""
        return self._paused or self._course is not None

    @property
    def paused(self) -> bool:
        """True while the robot is to stand."""
        return self._paused

    def take(self, wish: Steer) -> str:
        """Take a wish, and return in words what is done.

        Raises:
            MacorError: there is no such planner or goal; nothing has changed.
        """
        self._check(wish)
        done = []
        with self._changed:
            if wish.pause is not None:
                self._paused = wish.pause
                done.append("pausing" if wish.pause else "going on")
            if wish.planner is not None or wish.goal is not None:
                self._course = wish
                done.append("a new course after this command")
            self._changed.notify_all()
        return ", ".join(done) or "nothing to do"

    def guard(self) -> None:
        """See that a robot may drive on.

        Raises:
            PausedError: it is to stand.
        """
        if self._paused:
            raise PausedError

    def hold(self, check: Callable[[], None]) -> None:
        """Wait for the end of a pause; `check` is called again and again, and may raise."""
        with self._changed:
            while self._paused:
                check()
                self._changed.wait(_LOOK)

    def course(self) -> Steer | None:
        """Return a new course once; None: there is none."""
        with self._changed:
            course, self._course = self._course, None
            return course


def steer_key(session: zenoh.Session, robot: str, helm: Helm) -> ActingKey:
    """Return the steer key of one robot, to be used as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: the robot's name in the keys.
        helm: takes what is wished.

    Raises:
        TelemetryError: the name cannot be part of a key.
    """

    def act(request: bytes) -> str:
        try:
            wish = Steer.parse(request, _LONGEST)
        except PayloadError as error:
            raise TelemetryError(str(error)) from None
        return helm.take(wish)

    return ActingKey(session, STEER, robot, act)


def ask_to_steer(session: zenoh.Session, robot: str, wish: Steer) -> str:
    """Ask the controller of a robot for something; return what it does, in words.

    Raises:
        TelemetryError: no controller takes the wish.
    """
    return ask_to_act(session, robot, STEER, wish)
