"""Client of a Khepera on any pySerial port: typed commands over the serial protocol.

A request that came to nothing is repeated only where carrying it out twice is the same as once:
questions, and settings that do not depend on what was before. Everything else is an error at
once. `recover` gets a robot back that was unplugged, switched off or reset.
"""

import logging
import os
import weakref
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final, Self

from khepera_protocol.serial.messages import Reply, build_request

from macor_hil.errors import GarbageError, LinkError, RobotError, SilenceError
from macor_hil.hardware.line.line_statistics import Meter
from macor_hil.hardware.line.serial_line import LONGEST_REPLY, Line, open_port
from macor_hil.hardware.robots.robot import FRONT_SENSORS, Look, WheelStatus, looked
from macor_hil.safety.interruption import undisturbed

__all__ = ["LONGEST_REPLY", "Khepera", "WheelStatus", "open_port"]

_log = logging.getLogger(__name__)

REPEATABLE: Final = frozenset("ABCDEFHIJKNO")
"""Letters of requests that may be sent again: all but those that count on what was before (G
beside a turning wheel, L that toggles) or that reach beyond the robot (P, R, T, W)."""

SETTINGS: Final = frozenset("AFJ")
"""Letters of settings that power-on forgets."""

_ATTEMPTS: Final = 3
_STOP_LIMIT: Final = 0.5
"""Seconds for which the reply to a stop is waited for, however slow the line: at 1200 baud, far
below what any Khepera speaks, it has come."""

_STANDING_LIMIT: Final = 0.3
"""Seconds after a stop within which both wheels must have come to rest."""

_PAUSE: Final = 0.2
"""Seconds between two attempts at getting a robot back."""

_NEAR_ZERO, _FAR_FROM_ZERO = 40, 80
"""Counts: a reset wheel has not got farther, and one is told from a reset wheel from here on."""

_STOP = build_request("D", 0, 0)
_SPEED = build_request("E")


class Khepera:
    """A Khepera on an open serial port; use as a context, so that every way out stops it.

    Args:
        port: an open pySerial port.
        reopen: opens that port again after it has failed; None: it cannot be.

    Attributes:
        clock: seconds on the clock that the port lives by: virtual for `khepera://`, else real.
        meter: counts requests and times their round trips on that clock.
    """

    top_speed = 127

    def __init__(self, port: Any, reopen: Callable[[], Any] | None = None) -> None:
        self._take(Line(port))
        self.meter = Meter()
        self._reopen = reopen
        self._broken = False
        self._failures = 0  # to get it back, in a row
        self._settings: dict[str, tuple[int, ...]] = {}
        self._counters: tuple[int, int] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def port(self) -> Any:
        """The pySerial port; another one after a reconnection."""
        return self._line.port

    def connect(self) -> tuple[str, ...]:
        """Clear the line and ask for the versions of BIOS and protocol.

        Raises:
            RobotError: nothing on the port answers like a Khepera.
        """
        self._line.clear()
        return self.request("B").text

    def halt(self) -> None:
        """Stop the robot, whatever an interrupted exchange has left on the line.

        A first stop goes out at once. When nothing more comes from the robot, a second one is
        confirmed, so that no reply to an earlier request is taken for the stop's. Then both
        wheels are seen to stand: a stop may have been bent on its way.

        Raises:
            RobotError: no stop was confirmed.
        """
        _halt(self._line)

    def recover(self, patience: float) -> bool:
        """Get the robot back: port, line, standstill, and the settings that a reset has lost.

        Args:
            patience: seconds to go on trying.

        Returns:
            Whether the robot had been reset: its way since the last `counters` is then unknown,
            and its counters have been set back to those.

        Raises:
            RobotError: it did not come back.
        """
        deadline = self.clock() + patience
        while True:
            try:
                reset = self._revive()
            except RobotError as error:
                self._failures += 1
                # a connection may be dead without anybody having said so
                self._broken = isinstance(error, LinkError) or self._failures % _ATTEMPTS == 0
                if self.clock() >= deadline:
                    raise
                _log.debug("not back yet: %s", error)
                self._line.pause(_PAUSE)
            else:
                self._failures = 0
                return reset

    def wait(self, seconds: float) -> None:
        """Let time pass on the port's clock."""
        self._line.pause(seconds)

    def close(self) -> None:
        """Stop the robot as far as the line still allows, and close the port, once."""
        self._end()

    def request(self, letter: str, *arguments: int) -> Reply:
        """Send a request and wait for its reply; repeat it where that is harmless.

        Raises:
            RobotError: no reply in time, a reply of another kind, or a failed port.
        """
        for attempt in range(1, _ATTEMPTS + 1):
            try:
                return self._exchange(letter, *arguments)
            except (SilenceError, GarbageError) as error:
                if letter not in REPEATABLE or attempt == _ATTEMPTS:
                    raise
                _log.info("again, after: %s", error)
                # a move that may have begun unseen is stopped before it begins again
                self._line.clear(_STOP.encode() if letter == "C" else b"")
        raise AssertionError("unreachable")

    def _exchange(self, letter: str, *arguments: int) -> Reply:
        request, start = build_request(letter, *arguments), self.clock()
        try:
            reply = self._line.exchange(request)
        except RobotError:
            self.meter.failed()
            raise
        self.meter.answered(self.clock() - start)
        if letter in SETTINGS:
            self._settings[letter] = arguments
        return reply

    def _take(self, line: Line) -> None:
        """Drive on a line, and answer for it that the robot stands at its end."""
        self._line = line
        self.clock = line.clock
        self._watch: Callable[..., Any] | None = getattr(line.port, "watch", None)
        self._end = weakref.finalize(self, _leave, line, os.getpid())

    def _revive(self) -> bool:
        if self._broken and self._reopen is not None:
            self._line.close()
            reset_seen = self._line.reset_seen
            line = Line(self._reopen())
            line.reset_seen = reset_seen
            self._end.detach()
            self._take(line)
            self._broken = False
        self.halt()
        left, right = self._exchange("H").values
        reset = self._line.reset_seen or self._looks_reset(left, right)
        if reset:
            for letter, values in self._settings.items():
                self._exchange(letter, *values)
            if self._counters is not None:
                self.set_counters(*self._counters)
        self._line.reset_seen = False
        return reset

    def _looks_reset(self, left: int, right: int) -> bool:
        """Return True if counters tell of a reset whose banner nobody heard."""
        if self._counters is None:
            return False
        return max(abs(left), abs(right)) < _NEAR_ZERO and (
            max(map(abs, self._counters)) > _FAR_FROM_ZERO
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

    def watch(self, limit: int, begin: float, seconds: float) -> tuple[int, ...]:
        """Return the proximity sensors; see `Followed`. Elsewhere than in this process: at once."""
        found = self._watched(limit, begin, seconds, -1.0)
        if found is None:
            return self.proximity()
        counts: tuple[int, ...] = found.counts
        return counts

    def follow(self, limit: int, begin: float, seconds: float, patience: float) -> Look:
        """Look at a robot on its way; see `Followed`. Elsewhere than in this process: once."""
        found = self._watched(limit, begin, seconds, patience)
        if found is None:
            return looked(self, limit, begin, seconds)
        if found.told is None:
            seen = max(found.counts[FRONT_SENSORS]) >= limit or found.elapsed < seconds
            return Look(found.counts, found.elapsed, None if seen else self.status())
        left, right = (WheelStatus(reached, False, error) for reached, error in found.told)
        return Look(found.counts, found.elapsed, (left, right))

    def _watched(self, limit: int, begin: float, seconds: float, patience: float) -> Any:
        """Return what a port in this process finds by asking itself; None: it does not."""
        if self._watch is None:
            return None
        start = self.clock()
        found = self._watch(limit, begin, seconds, patience)
        if found is not None:
            self.meter.watched(found.exchanges, self.clock() - start, found.longest)
        return found

    def battery(self) -> int:
        """Return half of the battery's voltage, in counts of 4 mV."""
        (counts,) = self.request("I", 0).values
        return counts


def _halt(line: Line) -> None:
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            line.clear(_STOP.encode())
            line.exchange(_STOP, _STOP_LIMIT)
            _await_rest(line)
        except RobotError:
            if attempt == _ATTEMPTS:
                raise
        else:
            return


def _await_rest(line: Line) -> None:
    start = line.clock()
    while any(speed := line.exchange(_SPEED, _STOP_LIMIT).values):
        if line.clock() - start > _STANDING_LIMIT:
            raise GarbageError(f"stopped, and the wheels still turn: {speed} counts / 10 ms")


def _leave(line: Line, process: int) -> None:
    """Stop the robot on a line as far as that still can be, and close the line."""
    if os.getpid() != process:
        return  # a copy of the process that drives it
    try:
        with undisturbed(), suppress(RobotError):  # the line is gone: nothing is left to say on it
            _halt(line)
    finally:
        line.close()
