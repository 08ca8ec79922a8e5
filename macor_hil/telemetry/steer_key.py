"""The steer key `macor/<robot>/steer`: pauses a run that allows it, or changes planner and goal.

Wishes come in a thread of Zenoh and wait until the command that is driven has ended. The robot
stands between two commands, so a pause needs no stop, and a new planner begins with a new look.
Only what names the key itself and holds a `Steer` counts, as with the stop key.
"""

import threading
from collections.abc import Callable
from contextlib import ExitStack
from typing import Final, Self

import zenoh
from khepera_protocol.text import printable
from khepera_protocol.zenoh.controller_payloads import Steer
from khepera_protocol.zenoh.keys import STEER
from khepera_protocol.zenoh.payload_model import PayloadError
from khepera_protocol.zenoh.reply import refusal

from macor_hil.errors import MacorError, TelemetryError
from macor_hil.telemetry.session import check_robot_name

_LONGEST: Final = 1_000
"""Bytes of a wish at most."""

_PATIENCE: Final = 2.0
_LOOK: Final = 0.05
"""Seconds between two looks for a signal during a pause."""


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
                done.append("pausing after this command" if wish.pause else "going on")
            if wish.planner is not None or wish.goal is not None:
                self._course = wish
                done.append("a new course after this command")
            self._changed.notify_all()
        return ", ".join(done) or "nothing to do"

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


class SteerKey:
    """The steer key of one robot; use as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: the robot's name in the keys.
        helm: takes what is wished.
    """

    def __init__(self, session: zenoh.Session, robot: str, helm: Helm) -> None:
        check_robot_name(robot)
        self._key = STEER.of(robot)
        self._helm = helm
        with ExitStack() as stack:
            stack.enter_context(session.declare_queryable(self._key, self._answer))
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            if str(query.key_expr) != self._key:
                return  # somebody looks at what there is, and means no harm
            try:
                payload = query.payload
                wish = Steer.parse(payload.to_bytes() if payload else b"", _LONGEST)
                said = self._helm.take(wish)
            except (PayloadError, MacorError) as error:
                query.reply_err(printable(str(error), 300), encoding=zenoh.Encoding.TEXT_PLAIN)
            else:
                query.reply(self._key, said, encoding=zenoh.Encoding.TEXT_PLAIN)


def ask_to_steer(session: zenoh.Session, robot: str, wish: Steer) -> str:
    """Ask the controller of a robot for something; return what it does, in words.

    Raises:
        TelemetryError: no controller takes the wish.
    """
    check_robot_name(robot)
    key = STEER.of(robot)
    replies = list(session.get(key, payload=wish.model_dump_json(), timeout=_PATIENCE))
    for reply in replies:
        if reply.ok:
            return printable(reply.ok.payload.to_bytes()[:300].decode(errors="backslashreplace"))
    if replies:
        raise TelemetryError(f"the controller of {robot} refuses: {refusal(replies[0])}")
    raise TelemetryError(
        f"nobody answers on the Zenoh key {key}: no controller drives {robot}, or it was not"
        " started with --steer-key"
    )
