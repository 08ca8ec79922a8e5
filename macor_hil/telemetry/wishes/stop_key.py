"""The stop key `macor/<robot>/stop`: ends a run that allows it, by a query or by a sample."""

from collections.abc import Callable
from typing import Final

import zenoh
from khepera_protocol.zenoh.keys import STOP
from khepera_protocol.zenoh.payload_model import PayloadError
from khepera_protocol.zenoh.payloads import Stop

from macor_hil.errors import TelemetryError
from macor_hil.telemetry.wishes.acting_key import ActingKey, ask_to_act

_LONGEST: Final = 100
"""Bytes of a request at most."""

_REQUEST: Final = Stop(stop=True)


def stop_key(session: zenoh.Session, robot: str, stop: Callable[[str], None]) -> ActingKey:
    """Return the stop key of one robot, to be used as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: the robot's name in the keys.
        stop: called, in a thread of the library, with who or what asked.

    Raises:
        TelemetryError: the name cannot be part of a key.
    """

    def act(request: bytes) -> str:
        try:
            Stop.parse(request, _LONGEST)
        except PayloadError:
            raise TelemetryError(
                f"{STOP.of(robot)} ends the run, if it is asked with the payload"
                f" {_REQUEST.model_dump_json()}"
            ) from None
        stop("the stop key")
        return "stopping"

    return ActingKey(session, STOP, robot, act, hears=True)


def ask_to_stop(session: zenoh.Session, robot: str) -> None:
    """Ask the controller of a robot to stop it.

    Raises:
        TelemetryError: no controller takes the request.
    """
    ask_to_act(session, robot, STOP, _REQUEST, to=" to stop")
