"""Client of a robot on a line, of any kind: requests sent again, stops, and a robot had back.

What a robot is asked and how it answers is the affair of its kind. A client answers for it that
the robot stands when it is closed, when nobody refers to it any more, and when the interpreter
ends.
"""

import logging
import os
import weakref
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final, Generic, Self, TypeVar

from macor_hil.errors import GarbageError, LinkError, RobotError, SilenceError
from macor_hil.hardware.line.line_statistics import Meter
from macor_hil.hardware.line.open_line import OpenLine
from macor_hil.safety.interruption import undisturbed

_log = logging.getLogger(__name__)

_ATTEMPTS: Final = 3

_PAUSE: Final = 0.2
"""Seconds between two attempts at getting a robot back."""

_Line = TypeVar("_Line", bound=OpenLine)
_Answer = TypeVar("_Answer")


class LineClient(ABC, Generic[_Line]):
    """A robot on an open serial port; use as a context, so that every way out stops it.

    Args:
        port: an open pySerial port.
        reopen: opens that port again after it has failed; None: it cannot be.
        line_of: makes the line of a port.
        stand: stops the robot on a line once, and raises RobotError where it is not seen to stand.

    Attributes:
        clock: seconds on the clock that the port lives by: virtual for `khepera://`, else real.
        meter: counts requests and times their round trips on that clock.
    """

    def __init__(
        self,
        port: Any,
        reopen: Callable[[], Any] | None,
        line_of: Callable[[Any], _Line],
        stand: Callable[[_Line], None],
    ) -> None:
        self.meter = Meter()
        self._reopen = reopen
        self._line_of = line_of
        self._stand = stand
        self._broken = False
        self._failures = 0  # to get it back, in a row
        self._take(line_of(port))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def port(self) -> Any:
        """The pySerial port; another one after a reconnection."""
        return self._line.port

    def halt(self) -> None:
        """Stop the robot, whatever an interrupted exchange has left on the line.

        A first stop goes out at once. When nothing more comes from the robot, a second one is
        confirmed, so that no reply to an earlier request is taken for the stop's. Then both
        wheels are seen to stand: a stop may have been bent on its way.

        Raises:
            RobotError: no stop was confirmed.
        """
        _halt(self._line, self._stand)

    def recover(self, patience: float) -> bool:
        """Get the robot back: port, line, standstill, and what a reset has lost.

        Args:
            patience: seconds to go on trying.

        Returns:
            Whether the robot had been reset: its way since the last `counters` is then unknown,
            and its counters go on from those.

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

    @abstractmethod
    def _resume(self) -> bool:
        """Go on with a robot that stands, and give it back what a reset has lost.

        Returns:
            Whether it has been reset.
        """

    def _take(self, line: _Line) -> None:
        """Drive on a line, and answer for it that the robot stands at its end."""
        self._line = line
        self.clock = line.clock
        self._end = weakref.finalize(self, _leave, line, self._stand, os.getpid())

    def _metered(self, ask: Callable[[], _Answer]) -> _Answer:
        """Ask once, and count it."""
        start = self.clock()
        try:
            answer = ask()
        except RobotError:
            self.meter.failed()
            raise
        self.meter.answered(self.clock() - start)
        return answer

    def _repeated(self, ask: Callable[[], _Answer], before: bytes) -> _Answer:
        """Ask until an answer comes, a few times; the line is cleared with bytes before each."""
        for _ in range(1, _ATTEMPTS):
            try:
                return ask()
            except (SilenceError, GarbageError) as error:
                _log.info("again, after: %s", error)
                self._line.clear(before)
        return ask()

    def _revive(self) -> bool:
        if self._broken and self._reopen is not None:
            self._line.close()
            reset_seen = self._line.reset_seen
            line = self._line_of(self._reopen())
            line.reset_seen = reset_seen
            self._end.detach()
            self._take(line)
            self._broken = False
        self.halt()
        reset = self._resume()
        self._line.reset_seen = False
        return reset


def looks_reset(now: tuple[int, int], before: tuple[int, int], near: int) -> bool:
    """Return True if counters tell of a reset that nobody heard.

    Args:
        now: what they read.
        before: what they read last.
        near: a reset wheel has not got farther, and is told from another from twice that on.
    """
    return max(map(abs, now)) < near and max(map(abs, before)) > 2 * near


def _halt(line: _Line, stand: Callable[[_Line], None]) -> None:
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            stand(line)
        except RobotError:
            if attempt == _ATTEMPTS:
                raise
        else:
            return


def _leave(line: _Line, stand: Callable[[_Line], None], process: int) -> None:
    """Stop the robot on a line as far as that still can be, and close the line."""
    if os.getpid() != process:
        return  # a copy of the process that drives it
    try:
        with undisturbed(), suppress(RobotError):  # the line is gone: nothing is left to say on it
            _halt(line, stand)
    finally:
        line.close()
