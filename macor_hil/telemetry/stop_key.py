"""The stop key `macor/<robot>/stop`: ends a run that allows it.

Only what names the key itself and holds a `Stop` counts: a query or a sample for all keys
(`macor/**`, `**`) is a look, and ends nothing.
"""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Final, Self

import zenoh
from khepera_protocol.zenoh.keys import STOP
from khepera_protocol.zenoh.payload_model import PayloadError
from khepera_protocol.zenoh.payloads import Stop
from khepera_protocol.zenoh.reply import refusal

from macor_hil.errors import TelemetryError
from macor_hil.telemetry.session import check_robot_name

_PATIENCE: Final = 2.0
_LONGEST: Final = 100
"""Bytes of a request at most."""

_REQUEST: Final = Stop(stop=True).model_dump_json()


class StopKey:
    """The stop key of one robot; use as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: the robot's name in the keys.
        stop: called, in a thread of the library, with who or what asked.
    """

    def __init__(self, session: zenoh.Session, robot: str, stop: Callable[[str], None]) -> None:
        check_robot_name(robot)
        self._key = STOP.of(robot)
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
            if str(query.key_expr) != self._key:
                return  # somebody looks at what there is, and means no harm
            if _says_so(query.payload):
                self._stop("the stop key")
                query.reply(self._key, "stopping", encoding=zenoh.Encoding.TEXT_PLAIN)
            else:
                reason = f"{self._key} ends the run, if it is asked with the payload {_REQUEST}"
                query.reply_err(reason, encoding=zenoh.Encoding.TEXT_PLAIN)

    def _hear(self, sample: zenoh.Sample) -> None:
        if str(sample.key_expr) == self._key and _says_so(sample.payload):
            self._stop("the stop key")


def _says_so(payload: zenoh.ZBytes | None) -> bool:
    if payload is None:
        return False
    try:
        Stop.parse(payload.to_bytes(), _LONGEST)
    except PayloadError:
        return False
    return True


def ask_to_stop(session: zenoh.Session, robot: str) -> None:
    """Ask the controller of a robot to stop it.

    Raises:
        TelemetryError: no controller takes the request.
    """
    check_robot_name(robot)
    key = STOP.of(robot)
    replies = list(session.get(key, payload=_REQUEST, timeout=_PATIENCE))
    if any(reply.ok for reply in replies):
        return
    if replies:
        raise TelemetryError(f"the controller of {robot} refuses to stop: {refusal(replies[0])}")
    raise TelemetryError(
        f"nobody answers on the Zenoh key {key}: no controller drives {robot}, or it was not"
        " started with --stop-key, or does not let you"
    )
