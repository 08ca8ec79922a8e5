"""What passed on a serial line, both ways and with times, as a file: see `docs/wire-log.md`.

One JSON object a line. Bytes stand in a string of the characters U+0000 to U+00FF, so that a log
can be read; times are seconds on the robot's clock.
"""

import json
import logging
import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fcntl import LOCK_EX, LOCK_NB, flock
from pathlib import Path
from stat import S_ISREG
from types import TracebackType
from typing import Any, Final, Self
from urllib.parse import quote, urlencode

from khepera_emulator.errors import EmulatorError
from khepera_emulator.faults import Happening
from khepera_emulator.line_coding import LineFormat

_log = logging.getLogger(__name__)

FORMAT: Final = "khepera-wire-log"
VERSION: Final = 1


@dataclass(frozen=True, slots=True)
class Entry:
    """Something that happened on the line.

    Attributes:
        time: seconds on the robot's clock: when a client wrote, when the last byte of a reply
            had reached it.
        what: request, reply, close, line or fault; later versions may have others.
        data: bytes of a request or reply.
        line: settings of the client's end.
    """

    time: float
    what: str
    data: bytes = b""
    line: LineFormat | None = None


@dataclass(frozen=True, slots=True)
class Recording:
    """A wire log.

    Attributes:
        url: an in-process robot like the recorded one.
        entries: what happened, in order.
    """

    url: str
    entries: tuple[Entry, ...]


class WireLog:
    """Writes a wire log; use as a context.

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
        """A client has written."""
        self._write(t=time, what="request", data=data.decode("latin-1"))

    def reply(self, time: float, data: bytes) -> None:
        """Bytes have reached the client."""
        self._write(t=time, what="reply", data=data.decode("latin-1"))

    def close(self, time: float) -> None:
        """The client has left."""
        self._write(t=time, what="close")

    def line(self, time: float, line: LineFormat | None) -> None:
        """The client's settings; written when they are new."""
        if line is None or line == self._line:
            return
        self._line = line
        settings = {"baud": line.baud, "bits": line.bits, "parity": line.parity, "stop": line.stop}
        self._write(t=time, what="line", **settings)

    def fault(self, happening: Happening) -> None:
        """A fault has happened."""
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
    handle = os.open(path, flags & ~os.O_TRUNC | os.O_CLOEXEC, 0o666)
    try:
        flock(handle, LOCK_EX | LOCK_NB)
        if S_ISREG(os.fstat(handle).st_mode):
            os.ftruncate(handle, 0)
    except BaseException:
        os.close(handle)
        raise
    return handle


def robot_url(arena: str, options: Iterable[tuple[str, str]]) -> str:
    """URL of an in-process robot; options that are empty are left out."""
    query = urlencode([(name, value) for name, value in options if value], quote_via=quote)
    return f"khepera://{arena}" + (f"?{query}" if query else "")


def read_log(path: Path) -> Recording:
    """Read a wire log. A last line that is not complete is left out.

    Raises:
        EmulatorError: it cannot be read, or is no wire log of this version.
    """
    try:
        lines = path.read_text(encoding="ascii").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise EmulatorError(f"cannot read the wire log {path}: {error}") from None
    header = _object(path, 1, lines[0])
    if header.get("format") != FORMAT:
        raise EmulatorError(f"{path} is no wire log: its first line names no {FORMAT}")
    if header.get("version") != VERSION:
        raise EmulatorError(
            f"{path} is a wire log of version {header.get('version')}; this program reads"
            f" version {VERSION}"
        )
    return Recording(str(header.get("url", "")), tuple(_entries(path, lines[1:-1])))


def _entries(path: Path, lines: Sequence[str]) -> Iterable[Entry]:
    for number, line in enumerate(lines, 2):
        values = _object(path, number, line)
        try:
            yield _entry(values)
        except (KeyError, TypeError, ValueError):
            raise EmulatorError(f"line {number} of {path} is no entry of a wire log") from None


def _entry(values: dict[str, Any]) -> Entry:
    what = str(values["what"])
    settings = None
    if what == "line":
        settings = LineFormat(
            int(values["baud"]), int(values["bits"]), str(values["parity"]), float(values["stop"])
        )
    data = str(values["data"]).encode("latin-1") if what in ("request", "reply") else b""
    return Entry(float(values["t"]), what, data, settings)


def _object(path: Path, number: int, line: str) -> dict[str, Any]:
    try:
        values = json.loads(line)
    except ValueError:
        values = None
    if not isinstance(values, dict):
        raise EmulatorError(f"line {number} of {path} is no JSON object: no wire log")
    return values
