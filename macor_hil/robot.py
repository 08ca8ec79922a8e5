"""Client of a Khepera on any pySerial port: typed commands over the serial protocol."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import serial

from macor_hil.errors import RobotError
from macor_hil.meter import Meter
from protocol.errors import ReplyError
from protocol.framing import LINE_END
from protocol.messages import Reply, build_request, parse_reply
from protocol.units import wire_time

LONGEST_REPLY = 64
"""Characters that the wait for a reply allows for (K with two large errors)."""

PATIENCE = 0.5
"""Seconds beyond the wire time that a reply may take."""

_QUIET = 0.05
"""Seconds without a byte after which nothing more is taken to be on its way."""

_BABBLE = 1.0
"""Seconds for which bytes that nobody asked for are waited out."""

_STOPS = 3
"""Attempts at having a stop confirmed."""


@dataclass(frozen=True, slots=True)
class WheelStatus:
    """What K says of one wheel.

    Attributes:
        reached: whether the target of the position controller is reached.
        speed_mode: whether the speed controller (or PWM) is in charge.
        error: control error in counts, or counts / 10 ms.
    """

    reached: bool
    speed_mode: bool
    error: int


def open_port(url: str, baud: int = 9600) -> Any:
    """Open a serial port, 8N2, for exclusive use where the system can do that.

    Args:
        url: a device such as /dev/ttyUSB0, or any pySerial URL, `khepera://` included.
        baud: rate in bits a second.

    Raises:
        RobotError: there is no such port, it is in use, or its URL is wrong.
    """
    if url.startswith("khepera://"):
        try:
            import khepera_emulator  # noqa: F401 - registers the URL scheme
        except ImportError:
            raise RobotError(
                f"{url} needs the emulator, which is not installed; install the extra 'emulator'"
            ) from None
    options: dict[str, Any] = {} if "://" in url else {"exclusive": True}
    try:
        return serial.serial_for_url(
            url, baudrate=baud, stopbits=serial.STOPBITS_TWO, timeout=PATIENCE, **options
        )
    except (serial.SerialException, OSError, ValueError) as error:
        raise RobotError(f"cannot open the serial port {url}: {error}") from None


class Khepera:
    """A Khepera on an open serial port; use as a context, so that every way out stops it.

    Attributes:
        port: the pySerial port.
        clock: seconds on the clock that the port lives by: virtual for `khepera://`, else real.
        meter: counts requests and times their round trips on that clock.
    """

    def __init__(self, port: Any) -> None:
        self.port = port
        self.meter = Meter()
        emulated = hasattr(port, "now")
        self.clock: Callable[[], float] = (lambda: port.now) if emulated else time.monotonic

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def connect(self) -> tuple[str, ...]:
        """Clear the line and ask for the versions of BIOS and protocol.

        Raises:
            RobotError: nothing on the port answers like a Khepera.
        """
        self._clear_line(LINE_END)
        return self.request("B").text

    def halt(self) -> None:
        """Stop the robot, whatever an interrupted exchange has left on the line.

        A first stop goes out at once. When nothing more comes from the robot, a second one is
        confirmed, so that no reply to an earlier request is taken for the stop's.

        Raises:
            RobotError: no stop was confirmed.
        """
        stop = build_request("D", 0, 0).encode()
        for attempt in range(1, _STOPS + 1):
            try:
                self._clear_line(LINE_END + stop)
                self.stop()
            except RobotError:
                if attempt == _STOPS:
                    raise
            else:
                return

    def close(self) -> None:
        """Stop the robot as far as the line still allows, and close the port."""
        try:
            self.halt()
        except RobotError:
            pass  # the line is gone: there is nothing left to say on it
        finally:
            self.port.close()

    def request(self, letter: str, *arguments: int) -> Reply:
        """Send a request and wait for its reply.

        Raises:
            RobotError: no reply in time, a reply of another kind, or a failed port.
        """
        start = self.clock()
        try:
            reply = self._exchange(letter, *arguments)
        except RobotError:
            self.meter.failed()
            raise
        self.meter.answered(self.clock() - start)
        return reply

    def _exchange(self, letter: str, *arguments: int) -> Reply:
        message = build_request(letter, *arguments)
        data = message.encode()
        limit = wire_time(len(data) + LONGEST_REPLY, self.port.baudrate or 9600) + PATIENCE
        try:
            self.port.timeout = limit
            self.port.write(data)
            line: bytes = self.port.read_until(b"\n", LONGEST_REPLY)
        except (OSError, serial.SerialException) as error:
            raise RobotError(
                f"sent {data!r}, then the serial port failed: {error}; is the cable in and the"
                " robot on?"
            ) from None
        if not line.endswith(b"\n"):
            got = f"only {line!r}" if line else "nothing"
            raise RobotError(
                f"sent {data!r} and got {got} within {limit:.2f} s; is the robot on, and at"
                f" {self.port.baudrate} baud?"
            )
        try:
            return parse_reply(message, line.rstrip(b"\r\n"))
        except ReplyError as error:
            raise RobotError(f"unexpected reply: {error}") from None

    def _clear_line(self, data: bytes) -> None:
        """Send bytes that begin by ending a half-sent request; drop what comes until it is quiet.

        Raises:
            RobotError: the port failed, or what is on it never pauses.
        """
        came = b""
        try:
            self.port.write(data)
            self.port.timeout = _QUIET
            start = self.clock()
            while came := self.port.read_until(b"\n", LONGEST_REPLY):
                if self.clock() - start > _BABBLE:
                    break
        except (OSError, serial.SerialException) as error:
            raise RobotError(f"sent {data!r}, then the serial port failed: {error}") from None
        if came:
            raise RobotError(
                f"sent {data!r}, and bytes have not stopped coming for {_BABBLE} s, the last ones"
                f" {came!r}; is this a Khepera's port, at {self.port.baudrate} baud?"
            )

    def set_speed(self, left: int, right: int) -> None:
        """Hold wheel speeds, counts / 10 ms."""
        self.request("D", left, right)

    def stop(self) -> None:
        """Stand still."""
        self.set_speed(0, 0)

    def go_to(self, left: int, right: int) -> None:
        """Drive both wheels to counter values with the position controller."""
        self.request("C", left, right)

    def set_profile(self, left: tuple[int, int], right: tuple[int, int]) -> None:
        """Top speed and acceleration of the position controller, each wheel; protocol units."""
        self.request("J", *left, *right)

    def set_counters(self, left: int, right: int) -> None:
        """Set the encoder counters."""
        self.request("G", left, right)

    def counters(self) -> tuple[int, int]:
        """The encoder counters, left and right."""
        left, right = self.request("H").values
        return left, right

    def status(self) -> tuple[WheelStatus, WheelStatus]:
        """State of the motion controllers, left and right."""
        values = self.request("K").values
        left, right = (
            WheelStatus(bool(reached), bool(mode), error)
            for reached, mode, error in (values[:3], values[3:])
        )
        return left, right

    def proximity(self) -> tuple[int, ...]:
        """The eight proximity sensors, 0 far to 1023 near."""
        return self.request("N").values
