"""Zenoh sessions of the controller and of those who watch it."""

import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import zenoh
from khepera_protocol.zenoh import session as zenoh_session
from khepera_protocol.zenoh.session import EndpointInUseError, SessionError

from macor_hil.errors import TelemetryError

_NAME = re.compile(r"[A-Za-z0-9_.-]+")


@contextmanager
def open_session(
    listen: Sequence[str], connect: Sequence[str], file: Path | None = None
) -> Iterator[zenoh.Session]:
    """Open a session for as long as it is used; see `khepera_protocol.zenoh.session`.

    Args:
        listen: endpoints to be found at; none: do not listen.
        connect: endpoints of peers, there now or later.
        file: a configuration file of Zenoh (JSON5); it then counts alone.

    Raises:
        TelemetryError: an endpoint is malformed or in use, or the file cannot be used.
    """
    with ExitStack() as stack:
        try:
            session = stack.enter_context(zenoh_session.open_session(listen, connect, file))
        except EndpointInUseError as error:
            raise TelemetryError(
                f"{error}, perhaps another controller; end it or give another --listen endpoint"
            ) from None
        except SessionError as error:
            hint = "" if file else "; an endpoint looks like tcp/127.0.0.1:7448"
            raise TelemetryError(f"{error}{hint}") from None
        yield session


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
