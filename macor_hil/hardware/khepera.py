"""Client of a Khepera on any pySerial port: typed commands over the serial protocol.

A request that came to nothing is repeated only where carrying it out twice is the same as once:
questions, and settings that do not depend on what was before. Everything else is an error at
once. `recover` gets a robot back that was unplugged, switched off or reset.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, Final

from khepera_protocol.serial.messages import Reply, build_request
from khepera_protocol.serial.units import battery_volts

from macor_hil.errors import GarbageError, SilenceError
from macor_hil.hardware.line.serial_line import LONGEST_REPLY, Line, open_port
from macor_hil.hardware.robots.client import LineClient, looks_reset
from macor_hil.hardware.robots.robot import Arc, Arrival, RobotKind, WheelStatus

__all__ = ["LONGEST_REPLY", "Khepera", "WheelStatus", "open_port"]

REPEATABLE: Final = frozenset("ABCDEFHIJKNO")
"""Letters of requests that may be sent again: all but those that count on what was before (G
beside a turning wheel, L that toggles) or that reach beyond the robot (P, R, T, W)."""

SETTINGS: Final = frozenset("AFJ")
"""Letters of settings that power-on forgets."""

_STOP_LIMIT: Final = 0.5
"""Seconds for which the reply to a stop is waited for, however slow the line: at 1200 baud, far
below what any Khepera speaks, it has come."""

_STANDING_LIMIT: Final = 0.3
"""Seconds after a stop within which both wheels must have come to rest."""

_NEAR_ZERO: Final = 40
"""Counts: a reset wheel has not got farther."""

_STOP = build_request("D", 0, 0)
_SPEED = build_request("E")


class Khepera(LineClient[Line]):
    """A Khepera on an open serial port; use as a context, so that every way out stops it.

    Args:
        port: an open pySerial port.
        reopen: opens that port again after it has failed; None: it cannot be.

    Attributes:
        clock: seconds on the clock that the port lives by: virtual for `khepera://`, else real.
        meter: counts requests and times their round trips on that clock.
    """

    kind = RobotKind.KHEPERA
    top_speed = 127

    def __init__(self, port: Any, reopen: Callable[[], Any] | None = None) -> None:
        super().__init__(port, reopen, Line, _stand)
        self._settings: dict[str, tuple[int, ...]] = {}
        self._counters: tuple[int, int] | None = None

    def connect(self) -> tuple[str, ...]:
        """Clear the line and ask for the versions of BIOS and protocol.

        Raises:
            RobotError: nothing on the port answers like a Khepera.
        """
        self._line.clear()
        return self.request("B").text

    def request(self, letter: str, *arguments: int) -> Reply:
        """Send a request and wait for its reply; repeat it where that is harmless.

        Raises:
            RobotError: no reply in time, a reply of another kind, or a failed port.
        """
        ask = partial(self._exchange, letter, *arguments)
        if letter not in REPEATABLE:
            return ask()
        # a move that may have begun unseen is stopped before it begins again
        return self._repeated(ask, _STOP.encode() if letter == "C" else b"")

    def _exchange(self, letter: str, *arguments: int) -> Reply:
        reply = self._metered(partial(self._line.exchange, build_request(letter, *arguments)))
        if letter in SETTINGS:
            self._settings[letter] = arguments
        return reply

    def _take(self, line: Line) -> None:
        super()._take(line)
        self._watch: Callable[..., Any] | None = getattr(line.port, "watch", None)
        self._drive: Callable[..., Any] | None = getattr(line.port, "drive", None)

    def _resume(self) -> bool:
        left, right = self._exchange("H").values
        known = self._counters
        unheard = known is not None and looks_reset((left, right), known, _NEAR_ZERO)
        if not (self._line.reset_seen or unheard):
            return False
        for letter, values in self._settings.items():
            self._exchange(letter, *values)
        if known is not None:
            self.set_counters(*known)
        return True

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
        """Set the encoder counters of a robot that stands.

        Where no reply comes, the counters themselves say whether it was done.
        """
        try:
            self._exchange("G", left, right)
        except (SilenceError, GarbageError):
            self._line.clear()
            now = self.counters()
            if now != (left, right):
                self._exchange("G", left, right)
        self._counters = left, right

    def counters(self) -> tuple[int, int]:
        """Return the encoder counters, left and right."""
        left, right = self.request("H").values
        self._counters = left, right
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
        """Return the eight proximity sensors, 0 far to 1023 near."""
        return self.request("N").values

    def watch(self, limit: int, until: float) -> tuple[int, ...]:
        """Return the proximity sensors; see `Followed`. Elsewhere than in this process: at once."""
        start = self.clock()
        watched = None if self._watch is None else self._watch(limit, until)
        if watched is None:
            return self.proximity()
        return self._note(watched, start)

    def drive(self, arc: Arc) -> Arrival | None:
        """Drive an arc; see `Followed`. Elsewhere than in this process: None."""
        if self._drive is None:
            return None
        for letter, numbers in (("J", arc.profile), ("C", arc.target)):
            build_request(letter, *numbers)  # refuses what no robot takes
        start = self.clock()
        driven = self._drive(*arc)
        if driven is None:
            return None
        self._settings["J"], self._counters = arc.profile, driven.counters
        return Arrival(driven.collided, self._note(driven.watched, start), driven.counters)

    def _note(self, watched: Any, start: float) -> tuple[int, ...]:
        """Count exchanges that a port in this process has had with itself; returns the sensors."""
        self.meter.watched(watched.exchanges, self.clock() - start, watched.longest)
        counts: tuple[int, ...] = watched.counts
        return counts

    def battery(self) -> float:
        """Return the battery's voltage."""
        (counts,) = self.request("I", 0).values
        return battery_volts(counts)


def _stand(line: Line) -> None:
    line.clear(_STOP.encode())
    line.exchange(_STOP, _STOP_LIMIT)
    start = line.clock()
    while any(speed := line.exchange(_SPEED, _STOP_LIMIT).values):
        if line.clock() - start > _STANDING_LIMIT:
            raise GarbageError(f"stopped, and the wheels still turn: {speed} counts / 10 ms")
