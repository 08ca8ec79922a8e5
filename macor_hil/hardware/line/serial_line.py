"""A serial line to a Khepera: bytes out, a reply in, within a time that the wire sets.

Nothing here waits without a limit, whatever is at the other end.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache, lru_cache
from math import inf
from pathlib import Path
from typing import Any, Final

import serial
from khepera_protocol.extras import how_to_install
from khepera_protocol.serial.commands import COMMANDS
from khepera_protocol.serial.errors import ReplyError
from khepera_protocol.serial.framing import LINE_END
from khepera_protocol.serial.messages import Reply, Request, parse_reply
from khepera_protocol.serial.units import wire_time

from macor_hil.errors import (
    GarbageError,
    LinkError,
    RobotResetError,
    SilenceError,
    WrongPortError,
)
from macor_hil.hardware.address import PortAddress
from macor_hil.hardware.line.descriptors import let_pyserial_poll
from macor_hil.hardware.line.stale_links import is_stale_link

LONGEST_REPLY: Final = 64
"""Characters of a line after which its end is not waited for: that of K has 35 at most."""

PATIENCE: Final = 0.25
"""Seconds beyond the wire time that a reply may take: the interpreter, an adapter that gathers
bytes for 16 ms, and a busy computer."""

QUIET: Final = 0.05
"""Seconds without a byte after which nothing more is taken to be on its way."""

BANNER: Final = (b"ROM of minirobot", b"Serial Communication Protocol")
"""Beginnings of the lines that a Khepera says when it starts."""

_BABBLE: Final = 1.0
"""Seconds for which bytes that nobody asked for are waited out."""

_LONGEST_ON_THE_WIRE: Final = 3.0
"""Seconds that a request and its reply may be on their way: at 300 baud they are all there."""

_WRITE_LIMIT: Final = 0.5

_REMEMBERED: Final = 512

_SPOILER: Final = b"?"
"""Makes nonsense of a request whose end was lost: half a number must not be driven to."""


def open_port(address: str | PortAddress, baud: int = 9600) -> Any:
    """Open a serial port, 8N2, for exclusive use where the system can do that.

    Args:
        address: a device such as /dev/ttyUSB0, or any pySerial URL, `khepera://` included.
        baud: rate in bits a second.

    Raises:
        WrongPortError: its URL is wrong, or what it needs is not installed.
        LinkError: there is no such port, it is in use, or its emulator has gone.
    """
    port = PortAddress.parse(address) if isinstance(address, str) else address
    url = port.text
    if port.embedded:
        try:
            import khepera_emulator  # noqa: F401 - registers the URL scheme
        except ImportError:
            raise WrongPortError(
                f"{url} needs the emulator, which is not installed; install the extra 'emulator'"
                f" with: {how_to_install('emulator')}"
            ) from None
    let_pyserial_poll()
    if is_stale_link(Path(url)):
        raise LinkError(f"the emulator behind the link {url} has gone; start it again")
    options: dict[str, Any] = {"exclusive": True} if port.is_device else {}
    if not port.limits_writes:
        options["write_timeout"] = _WRITE_LIMIT
    try:
        return serial.serial_for_url(
            url, baudrate=baud, stopbits=serial.STOPBITS_TWO, timeout=QUIET, **options
        )
    except (serial.SerialException, OSError, ValueError) as error:
        # a robot in this process is there, or never will be; a ValueError is of the URL
        is_wrong = port.embedded or not isinstance(error, OSError)
        kind = WrongPortError if is_wrong else LinkError
        raise kind(f"cannot open the serial port {url}: {error}") from None


class Line:
    """Requests and replies over an open port.

    Attributes:
        port: the pySerial port.
        clock: seconds on the clock that the port lives by: virtual for `khepera://`, else real.
        reset_seen: whether a robot's banner has come since this was last set to False.
    """

    def __init__(self, port: Any) -> None:
        self.port = port
        self.emulated = hasattr(port, "now")
        self.clock: Callable[[], float] = (lambda: port.now) if self.emulated else time.monotonic
        self.reset_seen = False
        # one time-out for good: to change it costs a remote port a negotiation
        if port.timeout != QUIET:
            port.timeout = QUIET

    def exchange(self, request: Request, limit: float = inf) -> Reply:
        """Send a request and wait for its reply.

        Args:
            request: what is asked.
            limit: seconds to wait at most, however slow the line is.

        Raises:
            SilenceError: no whole line came within `time_limit`, or within the limit.
            GarbageError: a reply of another kind.
            RobotResetError: the robot's banner came instead.
            LinkError: the port failed.
        """
        data, needed = _framed(request, self._baud)
        limit = min(limit, needed)
        try:
            line = self._ask(data, limit)
        except (OSError, serial.SerialException) as error:
            raise _failed(data, error) from None
        if line.startswith(BANNER):
            self.reset_seen = True
            raise RobotResetError(
                f"sent {data!r} and got {line!r}: the robot has started again; is its battery low?",
                data,
                line,
            )
        if not line.endswith(b"\n"):
            got = f"only {line!r}" if line else "nothing"
            raise SilenceError(
                f"sent {data!r} and got {got} within {limit:.2f} s; is the robot on, and at"
                f" {self._baud} baud?",
                data,
                line,
            )
        try:
            return parse_reply(request, line.rstrip(b"\r\n"))
        except ReplyError as error:
            raise GarbageError(f"unexpected reply: {error}", data, line) from None

    def clear(self, data: bytes = b"") -> None:
        """Spoil a half-sent request, send bytes, and drop what comes until it is quiet.

        A robot answers this. That is waited for as long as for a reply: what came later would pass
        for the reply to the next request.

        Raises:
            LinkError: the port failed.
            GarbageError: what is on it never pauses.
        """
        data = _SPOILER + LINE_END + data
        try:
            last = self._drain(data)
        except (OSError, serial.SerialException) as error:
            raise _failed(data, error) from None
        if last:
            raise GarbageError(
                f"sent {data!r}, and bytes have not stopped coming for {_BABBLE} s, the last ones"
                f" {last!r}; is this a Khepera's port, at {self._baud} baud?",
                data,
                last,
            )

    def pause(self, seconds: float) -> None:
        """Let time pass on the port's clock; what comes meanwhile is dropped."""
        end = self.clock() + seconds
        while self.emulated and self.clock() < end:
            self.port.read()
        if not self.emulated:
            time.sleep(seconds)

    def close(self) -> None:
        """Close the port, as far as it still can be."""
        with suppress(OSError, serial.SerialException):  # a device that has gone
            self.port.close()

    @property
    def _baud(self) -> int:
        return int(self.port.baudrate or 9600)

    def _ask(self, data: bytes, limit: float) -> bytes:
        port = self.port
        port.write(data)
        start = self.clock()
        line: bytes = port.read_until(b"\n", LONGEST_REPLY)
        while not line.endswith(b"\n") and len(line) < LONGEST_REPLY:
            if self.clock() - start >= limit:
                break
            line += port.read_until(b"\n", LONGEST_REPLY - len(line))
        return line

    def _drain(self, data: bytes) -> bytes:
        self.port.write(data)
        start = self.clock()
        limit = wire_time(len(data), self._baud) + PATIENCE
        last, awaited = b"", data.count(b"\n")
        while self.clock() - start <= _BABBLE:
            came = self.port.read_until(b"\n", LONGEST_REPLY)
            if came:
                last = bytes(came)
                awaited -= last.endswith(b"\n")
                self.reset_seen = self.reset_seen or last.startswith(BANNER)
            elif awaited <= 0 or self.clock() - start >= limit:
                return b""
        return last


def _failed(data: bytes, error: Exception) -> LinkError:
    return LinkError(
        f"sent {data!r}, then the serial port failed: {error}; is the cable in and the robot on?",
        data,
    )


@lru_cache(_REMEMBERED)
def _framed(request: Request, baud: int) -> tuple[bytes, float]:
    """Return bytes of a request and its `time_limit`: programs send the same ones repeatedly."""
    return request.encode(), time_limit(request, baud)


def time_limit(request: Request, baud: int) -> float:
    """Return the seconds within which a reply must have come, from its request's first byte."""
    on_the_wire = wire_time(len(request.encode()) + longest_reply(request.letter), baud)
    return min(on_the_wire, _LONGEST_ON_THE_WIRE) + PATIENCE


@cache
def longest_reply(letter: str) -> int:
    """Return the characters of the longest reply to a command, its line end included."""
    command = COMMANDS[letter]
    if command.open_ended:
        return LONGEST_REPLY
    if command.reply_is_text:
        return 1 + len(",0.00") * len(command.reply) + len(LINE_END)
    widths = (1 + max(len(str(f.low)), len(str(f.high))) for f in command.reply)
    return 1 + sum(widths) + len(LINE_END)
