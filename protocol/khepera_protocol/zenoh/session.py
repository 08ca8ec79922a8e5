"""Opens Zenoh sessions for both programs, and says in one sentence why one cannot be opened.

Two settings hold in every session, whatever a configuration file says. Shared memory is off: a
watcher would keep the memory and the descriptors of every publisher that ever came. Messages are
bounded: nobody makes this process hold more than a picture may have.

With `RUST_LOG` in the environment (`RUST_LOG=zenoh=debug`) Zenoh says what it does, on standard
output.
"""

import json
import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import zenoh

from khepera_protocol.text import printable
from khepera_protocol.zenoh.config import MOST_MESSAGE, zenoh_config
from khepera_protocol.zenoh.diagnosis import TLS, Tls, reason_of_silence

_log = logging.getLogger(__name__)

_TLS_FILES: Final = (
    "root_ca_certificate",
    "listen_certificate",
    "listen_private_key",
    "connect_certificate",
    "connect_private_key",
)
_FILES: Final = (
    *(f"{TLS}/{name}" for name in _TLS_FILES),
    "transport/auth/usrpwd/dictionary_file",
    *(f"transport/auth/pubkey/{name}_file" for name in ("public_key", "private_key", "known_keys")),
)
"""Places of a configuration where files are named."""

_SHARED_MEMORY: Final = "transport/shared_memory/enabled"
_MESSAGE_SIZE: Final = "transport/link/rx/max_message_size"


class SessionError(Exception):
    """A session cannot be opened; the message says why, fit for a terminal."""


class _EndpointInUseError(SessionError):
    """Another program listens on an endpoint already."""


@contextmanager
def open_session(
    listen: Sequence[str],
    connect: Sequence[str],
    file: Path | None = None,
    *,
    error: Callable[[str], Exception] = SessionError,
    if_in_use: str = "",
) -> Iterator[zenoh.Session]:
    """Open a session for as long as it is used: a process with an open one may never exit.

    Where peers come and go at the same moment, closing may time out. That is logged: everything has
    been said by then.

    Args:
        listen: endpoints to be found at; none: do not listen.
        connect: endpoints of peers, there now or later.
        file: a configuration file of Zenoh (JSON5), which overrides both.
        error: makes the program's own error of a sentence.
        if_in_use: advice of the program where an endpoint is in use.

    Raises:
        SessionError: (or `error`) an endpoint is malformed or in use, or the file cannot be used,
            or no peer that it says to connect to lets this program in.
    """
    zenoh.try_init_log_from_env()
    try:
        session = _session(listen, connect, file)
    except _EndpointInUseError as failure:
        raise error(f"{failure}{if_in_use}") from None
    except SessionError as failure:
        hint = "" if file else "; an endpoint looks like tcp/127.0.0.1:7447"
        raise error(f"{failure}{hint}") from None
    try:
        yield session
    finally:
        try:
            session.close()
        except zenoh.ZError as failure:
            _log.warning("a Zenoh session does not close: %s", _text(failure))


def _session(listen: Sequence[str], connect: Sequence[str], file: Path | None) -> zenoh.Session:
    if file is not None:
        return _open(read_configuration(file), f"as {file} says")
    where = f"on {', '.join([*listen, *connect])}"
    return _open(_configuration(listen, connect, where), where)


def _configuration(listen: Sequence[str], connect: Sequence[str], where: str) -> zenoh.Config:
    try:
        return zenoh.Config.from_json5(zenoh_config(listen, connect))
    except zenoh.ZError as error:
        raise SessionError(f"cannot open a Zenoh session {where}: {_text(error)}") from None


def read_configuration(file: Path) -> zenoh.Config:
    """Return the configuration of a file, with what holds in every session.

    Raises:
        SessionError: the file, or one that it names, is missing or cannot be read.
    """
    why = f"cannot open a Zenoh session as {file} says"
    try:
        file.read_bytes()
        config = zenoh.Config.from_file(str(file))
    except OSError as error:
        raise SessionError(
            f"cannot read the Zenoh configuration {file}: {error.strerror}"
        ) from None
    except zenoh.ZError as error:
        raise SessionError(f"{why}: {_text(error)}") from None
    for place in _FILES:
        if name := json.loads(config.get_json(place)):
            _check_readable(Path(name), f"{why}: its {place}")
    config.insert_json5(_SHARED_MEMORY, "false")
    size = min(MOST_MESSAGE, json.loads(config.get_json(_MESSAGE_SIZE)))
    config.insert_json5(_MESSAGE_SIZE, str(size))
    return config


def _check_readable(path: Path, what: str) -> None:
    try:
        path.read_bytes()
    except OSError as error:
        start = "" if path.is_absolute() else f" (paths count from {Path.cwd()})"
        raise SessionError(f"{what}, {path}: {error.strerror}{start}") from None


def _open(config: zenoh.Config, where: str) -> zenoh.Session:
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        text = _text(error)
        what = f"cannot open a Zenoh session {where}: "
        if "Address already in use" in text:
            taken = ", ".join(_flat(json.loads(config.get_json("listen/endpoints"))))
            raise _EndpointInUseError(f"another program listens on {taken} already") from None
        if "nable to connect" in text:
            endpoints = json.loads(config.get_json("connect/endpoints"))
            tls: Tls = json.loads(config.get_json(TLS))
            text = "; ".join(reason_of_silence(each, tls) for each in _flat(endpoints)) or text
        raise SessionError(what + text) from None


def _flat(endpoints: object) -> list[str]:
    """Return the endpoints of a setting that may be a list, or one for each mode."""
    if isinstance(endpoints, dict):
        return [each for part in endpoints.values() for each in _flat(part)]
    if isinstance(endpoints, list):
        return [each for part in endpoints for each in _flat(part)]
    return [endpoints] if isinstance(endpoints, str) else []


def _text(error: zenoh.ZError) -> str:
    """Return the library's reason without places in its own source, on one line."""
    lines = (line.strip() for line in str(error).partition(" at /")[0].splitlines())
    return printable(" ".join(filter(None, lines)), 400).rstrip(".")
