"""The stop key `macor/<robot>/stop`: whoever reaches it may end a run, if the run allows it.

Only what names the key itself and holds a `Stop` counts: a query or a sample for all keys
(`macor/**`, `**`) is a look, and ends nothing.
"""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Final, Self

import zenoh

from macor_hil.errors import TelemetryError
from macor_hil.telemetry.keys import STOP
from macor_hil.telemetry.session import check_robot_name, refusal
from protocol.side_channel import PayloadError, Stop, controller_key

_PATIENCE: Final = 2.0
_LONGEST: Final = 100
"""Bytes of a request at most."""

_REQUEST: Final = Stop(stop=True).model_dump_json()


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
            if self._is_meant(query.key_expr, query.payload):
                self._stop("the stop key")
                query.reply(self._key, "stopping", encoding=zenoh.Encoding.TEXT_PLAIN)
            else:
                query.reply_err(
                    f"{self._key} ends the run; to do so, ask this very key with the payload"
                    f" {_REQUEST}",
                    encoding=zenoh.Encoding.TEXT_PLAIN,
                )

    def _hear(self, sample: zenoh.Sample) -> None:
        if self._is_meant(sample.key_expr, sample.payload):
            self._stop("the stop key")

    def _is_meant(self, key: zenoh.KeyExpr, payload: zenoh.ZBytes | None) -> bool:
        """Return whether somebody wants the run to end, rather than looks at all keys."""
        if str(key) != self._key or payload is None or len(payload) > _LONGEST:
            return False
        try:
            Stop.parse(payload.to_bytes())
        except PayloadError:
            return False
        return True


def ask_to_stop(session: zenoh.Session, robot: str) -> None:
    """Ask the controller of a robot to stop it.

    Raises:
        TelemetryError: no controller takes the request.
    """
    check_robot_name(robot)
    key = controller_key(robot, STOP)
    replies = list(session.get(key, payload=_REQUEST, timeout=_PATIENCE))
    if any(reply.ok for reply in replies):
        return
    if replies:
        raise TelemetryError(f"the controller of {robot} refuses to stop: {refusal(replies[0])}")
    raise TelemetryError(
        f"nobody answers on the Zenoh key {key}: no controller drives {robot}, or it was not"
        " started with --stop-key, or does not let you"
    )
