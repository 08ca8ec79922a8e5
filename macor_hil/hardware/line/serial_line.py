"""A serial line to a Khepera: bytes out, a reply in, within a time that the wire sets.

Nothing here waits without a limit, whatever is at the other end.
"""

import errno
import glob
import os
from functools import cache, lru_cache
from math import inf
from pathlib import Path
from typing import Any, Final

import serial
from khepera_protocol.extras import how_to_install
from khepera_protocol.serial.commands import COMMANDS
from khepera_protocol.serial.errors import ReplyError
from khepera_protocol.serial.framing import LINE_END
from khepera_protocol.serial.messages import BANNER, Reply, Request, parse_reply
from khepera_protocol.serial.units import wire_time

from macor_hil.errors import GarbageError, LinkError, SilenceError, WrongPortError
from macor_hil.hardware.address import PortAddress
from macor_hil.hardware.line.descriptors import let_pyserial_poll
from macor_hil.hardware.line.open_line import BABBLE, PORT_ERRORS, QUIET, OpenLine, port_failed
from macor_hil.hardware.line.stale_links import is_stale_link

LONGEST_REPLY: Final = 64
"""Characters of a line after which its end is not waited for: that of K has 35 at most."""

PATIENCE: Final = 0.25
"""Seconds beyond the wire time that a reply may take: the interpreter, an adapter that gathers
bytes for 16 ms, and a busy computer."""

_LONGEST_ON_THE_WIRE: Final = 3.0
"""Seconds that a request and its reply may be on their way: at 300 baud they are all there."""

_WRITE_LIMIT: Final = 0.5

_REMEMBERED: Final = 512
_MOST_NAMES: Final = 8
"""Ports of similar names that are told."""

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
    url = port.url
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
        raise kind(f"cannot open the serial port {url}: {_reason(url, error)}") from None


def _reason(url: str, error: Exception) -> str:
    """Return why a port cannot be opened, once: pySerial says it twice, in the words of Python."""
    number = error.errno if isinstance(error, OSError) else None
    if number == errno.EAGAIN:
        return "another program has it, such as another controller"
    if number == errno.ENOENT:
        near = sorted(
            path.name for path in Path(url).parent.glob(f"{glob.escape(Path(url).name)}-*")
        )
        there = f"; there are {', '.join(near[:_MOST_NAMES])}" if near else ""
        return f"there is no such file{there}"
    return os.strerror(number) if number else str(error)


class Line(OpenLine):
    """Requests and replies over an open port; see `OpenLine`."""

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
        data, needed = _framed(request, self.baud)
        limit = min(limit, needed)
        try:
            line = self._ask(data, limit)
        except PORT_ERRORS as error:
            raise port_failed(data, error) from None
        if line.startswith(BANNER):
            raise self.restarted(data, line)
        if not line.endswith(b"\n"):
            got = f"only {line!r}" if line else "nothing"
            raise SilenceError(
                f"sent {data!r} and got {got} within {limit:.2f} s; is the robot on, and at"
                f" {self.baud} baud?",
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
        except PORT_ERRORS as error:
            raise port_failed(data, error) from None
        if last:
            raise GarbageError(
                f"sent {data!r}, and bytes have not stopped coming for {BABBLE} s, the last ones"
                f" {last!r}; is this a Khepera's port, at {self.baud} baud?",
                data,
                last,
            )

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
        limit = wire_time(len(data), self.baud) + PATIENCE
        last, awaited = b"", data.count(b"\n")
        while self.clock() - start <= BABBLE:
            came = self.port.read_until(b"\n", LONGEST_REPLY)
            if came:
                last = bytes(came)
                awaited -= last.endswith(b"\n")
                self.reset_seen = self.reset_seen or last.startswith(BANNER)
            elif awaited <= 0 or self.clock() - start >= limit:
                return b""
        return last


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
