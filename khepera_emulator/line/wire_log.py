"""Wire logs: all that passed on a serial line, with times, as a file; see `docs/wire-log.md`.

One JSON object a line. Bytes stand in a string of the characters U+0000 to U+00FF, so that a log
can be read; times are seconds on the robot's clock.
"""

import json
import logging
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from stat import S_ISREG
from types import MappingProxyType, TracebackType
from typing import Any, BinaryIO, Final, Literal, Self

from khepera_protocol.system.locking import lock_now
from khepera_protocol.system.opening import UNSHARED
from khepera_protocol.text import printable
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import from_json

from khepera_emulator.arenas.mistakes import describe
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.coding import LineFormat
from khepera_emulator.line.fault import Happening

_log = logging.getLogger(__name__)

FORMAT: Final = "khepera-wire-log"
VERSION: Final = 1

_LONGEST_LINE: Final = 100_000
"""Bytes of a line, its end included: a chunk of a client's has four thousand."""

_LONGEST_URL: Final = 4096
_MOST_ENTRIES: Final = 2_000_000
_MOST_BYTES: Final = 1_000_000_000
_MOST_TIME: Final = 1e9
_LONGEST_SILENCE: Final = 1e7
"""Seconds between two entries, on a clock that may run a thousand times faster than ours."""


@dataclass(frozen=True, slots=True)
class Entry:
    """Something that happened on the line.

    Attributes:
        time: seconds on the robot's clock: when a client wrote, when the last byte of a reply
            had reached it.
        what: request, reply, close, line or fault; later versions may have others.
        data: bytes of a request or reply.
        line: settings of the client's end.
        text: of a fault: the bytes' direction, its kind, and what it did.
    """

    time: float
    what: str
    data: bytes = b""
    line: LineFormat | None = None
    text: str = ""

    def __str__(self) -> str:
        """Show it in a line of text, bytes as in Python."""
        what = repr(self.data)[1:] if self.data else str(self.line or printable(self.text))
        return f"{self.time:10.4f} s  {self.what:<7}  {what}".rstrip()


@dataclass(frozen=True, slots=True)
class Recording:
    """A wire log.

    Attributes:
        url: an in-process robot like the recorded one, as the file says.
        entries: what happened, in order.
        damage: why there are no more entries, in a sentence; empty: the log is whole.
    """

    url: str
    entries: tuple[Entry, ...]
    damage: str = ""


class WireLog:
    """Writer of a wire log; use as a context.

    Where no more can be written, on a full disk, the log ends and says so; the robot goes on.

    Args:
        path: the file; one that is there is replaced.
        url: an in-process robot like the recorded one.

    Raises:
        EmulatorError: the file cannot be written.
    """

    def __init__(self, path: Path, url: str) -> None:
        try:
            # a line at a time: a killed emulator leaves whole ones
            self._file = open(  # noqa: SIM115 - Path.open knows no opener
                path, "w", buffering=1, encoding="ascii", newline="\n", opener=_open_alone
            )
        except BlockingIOError:
            raise EmulatorError(f"cannot record to {path}: another emulator does") from None
        except OSError as error:
            raise EmulatorError(f"cannot record to {path}: {error.strerror}") from None
        self._path = path
        self._line: LineFormat | None = None
        try:
            self._put(format=FORMAT, version=VERSION, url=url)
        except OSError as error:
            self._close()
            raise EmulatorError(f"cannot record to {path}: {error.strerror}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._close()

    def request(self, time: float, data: bytes) -> None:
        """Write what a client has written."""
        self._write(t=time, what="request", data=data.decode("latin-1"))

    def reply(self, time: float, data: bytes) -> None:
        """Write bytes that have reached the client."""
        self._write(t=time, what="reply", data=data.decode("latin-1"))

    def close(self, time: float) -> None:
        """Write that the client has left."""
        self._write(t=time, what="close")

    def line(self, time: float, line: LineFormat | None) -> None:
        """Write the client's settings when they are new."""
        if line is None or line == self._line:
            return
        self._line = line
        settings = {"baud": line.baud, "bits": line.bits, "parity": line.parity, "stop": line.stop}
        self._write(t=time, what="line", **settings)

    def fault(self, happening: Happening) -> None:
        """Write a fault that has happened."""
        self._write(
            t=happening.time,
            what="fault",
            direction=happening.direction,
            kind=happening.kind,
            text=happening.what,
        )

    def _write(self, **values: object) -> None:
        if self._file.closed:
            return
        try:
            self._put(**values)
        except OSError as error:
            _log.error(
                "the recording %s ends here: %s; the robot goes on", self._path, error.strerror
            )
            self._close()

    def _put(self, **values: object) -> None:
        self._file.write(json.dumps(values) + "\n")

    def _close(self) -> None:
        with suppress(OSError):  # what is left of a line that there is no room for
            self._file.close()


def _open_alone(path: str, flags: int) -> int:
    """Open a file that nobody else writes as a log, and only then empty it."""
    handle = os.open(path, flags & ~os.O_TRUNC | UNSHARED, 0o666)
    try:
        lock_now(handle)
        if S_ISREG(os.fstat(handle).st_mode):
            os.ftruncate(handle, 0)
    except BaseException:
        os.close(handle)
        raise
    return handle


class _Moment(BaseModel):
    """Keys that every entry has."""

    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False)

    t: float = Field(ge=0.0, le=_MOST_TIME)
    what: str


class _Bytes(_Moment):
    """A request or a reply."""

    data: str


class _Settings(_Moment):
    """Settings of the client's end."""

    baud: int = Field(ge=1, le=10_000_000)
    bits: int = Field(ge=5, le=8)
    parity: Literal["N", "E", "O", "M", "S"]
    stop: float = Field(ge=1.0, le=2.0)


class _Fault(_Moment):
    """A fault of the line."""

    direction: str = ""
    kind: str = ""
    text: str = ""


_KINDS: Final[Mapping[str, type[_Moment]]] = MappingProxyType(
    {"request": _Bytes, "reply": _Bytes, "line": _Settings, "fault": _Fault}
)


def read_log(path: Path) -> Recording:
    """Read a wire log up to its end, or to the first line that is damaged.

    A last line that is not complete is left out: a killed emulator leaves one.

    Raises:
        EmulatorError: it cannot be read, or is no wire log of this version.
    """
    entries: list[Entry] = []
    try:
        with path.open("rb") as file:
            url = _url(path, file)
            try:
                entries.extend(_entries(path, file))
            except EmulatorError as error:
                return Recording(url, tuple(entries), str(error))
    except OSError as error:
        raise EmulatorError(
            f"cannot read the wire log {printable(str(path), 300)}: {error.strerror}"
        ) from None
    return Recording(url, tuple(entries))


def _url(path: Path, file: BinaryIO) -> str:
    """Read the first line."""
    header = _object(path, 1, file.readline(_LONGEST_LINE))
    if header.get("format") != FORMAT:
        raise EmulatorError(f"{path} is no wire log: its first line names no {FORMAT}")
    if header.get("version") != VERSION:
        version = printable(str(header.get("version")), 20)
        raise EmulatorError(
            f"{path} is a wire log of version {version}; this program reads version {VERSION}"
        )
    url = header.get("url", "")
    if not isinstance(url, str) or len(url) > _LONGEST_URL:
        raise EmulatorError(f"{path} is no wire log: its url is no text of a robot's URL")
    return url


def _entries(path: Path, file: BinaryIO) -> Iterator[Entry]:
    latest, size = 0.0, 0
    for number in count(2):
        line = file.readline(_LONGEST_LINE)
        size += len(line)
        if number > _MOST_ENTRIES or size > _MOST_BYTES:
            raise EmulatorError(
                f"{path} is longer than {_MOST_ENTRIES:,} lines or {_MOST_BYTES:,} bytes"
            )
        if not line.endswith(b"\n"):
            if len(line) == _LONGEST_LINE:
                raise EmulatorError(f"line {number} of {path} is too long for a wire log")
            return
        entry = _entry(path, number, line)
        if entry.time > latest + _LONGEST_SILENCE and entry.what != "fault":
            silence = entry.time - latest
            raise EmulatorError(f"line {number} of {path} comes after {silence:g} s of silence")
        latest = max(latest, entry.time) if entry.what != "fault" else latest
        yield entry


def _entry(path: Path, number: int, line: bytes) -> Entry:
    values = _object(path, number, line)
    kind = _KINDS.get(str(values.get("what")), _Moment)
    try:
        given = kind.model_validate(values)
        data = given.data.encode("latin-1") if isinstance(given, _Bytes) else b""
    except ValidationError as error:
        why = describe(error, kind)
    except UnicodeEncodeError:
        why = "data: a character is beyond U+00FF, and is no byte"
    else:
        settings = None
        if isinstance(given, _Settings):
            settings = LineFormat(given.baud, given.bits, given.parity, given.stop)
        text = ""
        if isinstance(given, _Fault):
            text = f"{given.direction} {given.kind}: {given.text}"
        return Entry(given.t, given.what, data, settings, text)
    raise EmulatorError(f"line {number} of {path} is no entry of a wire log: {why}")


def _object(path: Path, number: int, line: bytes) -> dict[str, Any]:
    try:
        values = from_json(line, allow_inf_nan=False)
    except ValueError:
        values = None
    if not isinstance(values, dict):
        raise EmulatorError(f"line {number} of {path} is no JSON object: no wire log")
    return values
