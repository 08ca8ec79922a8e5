"""Zenoh sessions of the controller and of those who watch it."""

import re
from collections.abc import Sequence
from pathlib import Path

import zenoh

from macor_hil.errors import TelemetryError
from protocol.zenoh_config import zenoh_config

_NAME = re.compile(r"[A-Za-z0-9_.-]+")


def open_session(
    listen: Sequence[str], connect: Sequence[str], file: Path | None = None
) -> zenoh.Session:
    """Open a session; use it as a context, a process with an open one may never exit.

    Args:
        listen: endpoints to be found at; none: do not listen.
        connect: endpoints of peers, there now or later.
        file: a configuration file of Zenoh (JSON5); it then counts alone.

    Raises:
        TelemetryError: an endpoint is malformed or in use, or the file cannot be used.
    """
    if file is not None:
        return _open_from(file)
    try:
        return zenoh.open(zenoh.Config.from_json5(zenoh_config(listen, connect)))
    except zenoh.ZError as error:
        if "Address already in use" in str(error):
            raise TelemetryError(
                f"another program, perhaps another controller, listens on {', '.join(listen)}"
                " already; end it or give another --listen endpoint"
            ) from None
        # the library's text ends with places in its own source
        reason = str(error).partition(" at /")[0]
        raise TelemetryError(
            f"cannot open a Zenoh session on {', '.join([*listen, *connect])}: {reason}; an"
            " endpoint looks like tcp/127.0.0.1:7448"
        ) from None


def _open_from(file: Path) -> zenoh.Session:
    try:
        return zenoh.open(zenoh.Config.from_file(str(file)))
    except zenoh.ZError as error:
        reason = str(error).partition(" at /")[0]
        raise TelemetryError(f"cannot open a Zenoh session as {file} says: {reason}") from None


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
