"""All robots that there are, each followed: found by the liveliness tokens of both sides."""

import time
from collections.abc import Collection
from contextlib import ExitStack, suppress
from typing import Final, Self

import zenoh
from khepera_protocol.text import in_order
from khepera_protocol.zenoh.keys import ALIVE

from macor_hil.errors import TelemetryError
from macor_hil.monitor.follower import Follower
from macor_hil.telemetry.inbox import Inbox

_MOST: Final = 64
"""Robots that are followed; of those that have gone the first one makes room."""


class Roster:
    """The robots of a Zenoh session, in the order of their names; use as a context.

    Args:
        session: an open session, which stays its owner's.
        names: those to follow, there or not; none: all that appear.

    Attributes:
        robots: followers by the robots' names; one that has gone stays.

    Raises:
        TelemetryError: a name cannot be part of a key.
    """

    def __init__(self, session: zenoh.Session, names: Collection[str] = ()) -> None:
        self.robots: dict[str, Follower] = {}
        self._session = session
        self._found: Inbox[str] = Inbox()
        with ExitStack() as stack:
            stack.callback(self._close)
            for name in names:
                self._follow(name)
            for key in ALIVE.values() if not names else ():
                token = session.liveliness().declare_subscriber(
                    key.of("*"), self._find, history=True
                )
                stack.enter_context(token)
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def drain(self, seconds: float) -> None:
        """Take in what has come, for so long at most, and wait for nothing."""
        while (name := self._found.get(0.0)) is not None:
            if name not in self.robots and self._has_room():
                with suppress(TelemetryError):  # a stranger's, that no robot can have
                    self._follow(name)
        end = time.monotonic() + seconds
        for follower in tuple(self.robots.values()):
            follower.drain(max(end - time.monotonic(), seconds / len(self.robots)))

    def _find(self, token: zenoh.Sample) -> None:
        name = str(token.key_expr).split("/")[1]
        if token.kind == zenoh.SampleKind.PUT:
            self._found.put(name, len(name))

    def _follow(self, name: str) -> None:
        self.robots[name] = Follower(self._session, name)
        self.robots = {each: self.robots[each] for each in sorted(self.robots, key=in_order)}

    def _has_room(self) -> bool:
        if len(self.robots) < _MOST:
            return True
        gone = next((name for name, each in self.robots.items() if not each.watched.alive), None)
        if gone is not None:
            self.robots.pop(gone).__exit__()
        return gone is not None

    def _close(self) -> None:
        for follower in self.robots.values():
            follower.__exit__()
