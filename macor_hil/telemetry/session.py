"""Zenoh sessions of the controller and of those who watch it."""

import re
from functools import partial
from typing import Final

from khepera_protocol.zenoh import session

from macor_hil.errors import TelemetryError

_NAME = re.compile(r"[A-Za-z0-9_.-]+")

open_session: Final = partial(
    session.open_session,
    error=TelemetryError,
    if_in_use=", perhaps another controller; end it or give another --listen endpoint",
)
"""Open a session for as long as it is used, see `khepera_protocol.zenoh.session`; a session that
cannot be opened is a TelemetryError."""


def check_robot_name(name: str) -> None:
    """Refuse a robot's name that cannot be part of a Zenoh key.

    Raises:
        TelemetryError: it has other characters than letters, digits, dots, dashes, underscores.
    """
    if not _NAME.fullmatch(name):
        raise TelemetryError(
            f"{name!r} is no robot's name: it is made of letters, digits, dots, dashes and"
            " underscores"
        )
