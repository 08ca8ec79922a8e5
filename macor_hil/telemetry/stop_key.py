"""The stop key `macor/<robot>/stop`: whoever reaches it may end a run, if the run allows it.

A query is answered once the request has been taken in; what is put on the key counts as well.
"""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Final, Self

import zenoh

from macor_hil.errors import TelemetryError
from macor_hil.telemetry.session import check_robot_name
from protocol.side_channel import controller_key

STOP: Final = "stop"

_PATIENCE: Final = 2.0


class StopKey:
    """Listens on the stop key of one robot; use as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: the robot's name in the keys.
        stop: called, in a thread of the library, with who or what asked.
    """

    def __init__(self, session: zenoh.Session, robot: str, stop: Callable[[str], None]) -> None:
        check_robot_name(robot)
        self._key = controller_key(robot, STOP)
        self._stop = stop
        with ExitStack() as stack:
            stack.enter_context(session.declare_queryable(self._key, self._answer))
            stack.enter_context(session.declare_subscriber(self._key, self._hear))
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            self._stop("the stop key")
            query.reply(self._key, "stopping", encoding=zenoh.Encoding.TEXT_PLAIN)

    def _hear(self, _: zenoh.Sample) -> None:
        self._stop("the stop key")


def ask_to_stop(session: zenoh.Session, robot: str) -> None:
    """Ask the controller of a robot to stop it.

    Raises:
        TelemetryError: no controller takes the request.
    """
    check_robot_name(robot)
    key = controller_key(robot, STOP)
    if not any(reply.ok for reply in session.get(key, timeout=_PATIENCE)):
        raise TelemetryError(
            f"nobody answers on the Zenoh key {key}: no controller drives {robot}, or it was not"
            " started with --stop-key, or does not let you"
        )
