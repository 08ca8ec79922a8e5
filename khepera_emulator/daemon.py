"""Emulated robots that live in real time: one thread for their lines, clock and queries.

Everything happens between two waits, for one robot after the other: bytes go from the client to
the robot, physics comes up to now, bytes whose wire time has passed go to the client, and one
query is answered.
"""

import logging
import os
import select
from collections.abc import Callable
from contextlib import suppress

from khepera_emulator.clock import Clock
from khepera_emulator.emulator import Emulator
from khepera_emulator.ports.port import Port
from khepera_emulator.side_channel import SideChannel
from khepera_emulator.wire_log import WireLog

_log = logging.getLogger(__name__)

CHUNK = 0.002
"""Real seconds that a byte may wait for the next ones; the last byte of a reply never waits."""

MOVING_PERIOD = 0.020
"""Real seconds between two steps while the robot moves: it never has much to catch up."""

RESTING_PERIOD = 0.100
"""Real seconds between two steps of a robot at rest."""

MOST_BEHIND = 0.25
"""Real seconds to catch up at once. A process that was stopped for longer, or is too slow for its
speed, loses the rest: the robot's clock stands still meanwhile."""

_TAKE = 256
"""Bytes taken from a client ahead of the line; the rest waits with it, as in a driver's buffer."""

_LEFT_BEHIND = 4096
"""Bytes of clients that have left that may wait for the line; more are dropped and counted."""


class Daemon:
    """Serves the emulated robots of one world, each on a port, and on a side channel if it has one.

    Args:
        emulator: the robot; its clock must not have begun. For more of them see `add`.
        port: its serial line.
        clock: the time it lives in.
        follow_rate: take the line's rate from the client's settings; otherwise a client with
            other settings than the robot's reads and sends garbage.
        channel: camera, ground truth and reset.
        log: where to write down what passes on the line.
    """

    def __init__(
        self,
        emulator: Emulator,
        port: Port,
        clock: Clock,
        *,
        follow_rate: bool = True,
        channel: SideChannel | None = None,
        log: WireLog | None = None,
    ) -> None:
        # time passes for all robots of a world when it passes for one
        self._emulator = emulator
        self._clock = clock
        self._lines: list[_Line] = []
        self.add(emulator, port, follow_rate=follow_rate, channel=channel, log=log)
        self._stopping = False
        self._stop = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)

    @property
    def lost(self) -> int:
        """Bytes of clients that were dropped before they reached a line."""
        return sum(line.lost for line in self._lines)

    def add(
        self,
        emulator: Emulator,
        port: Port,
        *,
        follow_rate: bool = True,
        channel: SideChannel | None = None,
        log: WireLog | None = None,
    ) -> None:
        """Serve another robot of the same world; arguments as for the first."""
        self._lines.append(_Line(emulator, port, follow_rate, channel, log))

    def stop(self) -> None:
        """End `run` soon; for signal handlers and other threads."""
        self._stopping = True
        with suppress(OSError):  # it has ended
            os.eventfd_write(self._stop, 1)

    def run(self) -> None:
        """Serve until `stop`."""
        try:
            while not self._stopping:
                self._wait()
                for line in self._lines:
                    line.serve_client(self._catch_up)
                    line.serve_channel(self._catch_up)
            for line in self._lines:
                line.serve_client(self._catch_up)  # what came before the stop counts
        finally:
            os.close(self._stop)
        for line in self._lines:
            line.log_losses()

    def _wait(self) -> None:
        """Sleep until a client, a query, a byte's wire time or a robot's motion wants something.

        `select` keeps its time-out to a tenth of a millisecond; `poll` and `epoll` round it up
        to a whole one, half a character at 9600.
        """
        readers = [self._stop]
        delay = MOVING_PERIOD if self._emulator.moving else RESTING_PERIOD
        for line in self._lines:
            readers += line.descriptors()
            delay = min(delay, line.delay(self._clock))
        select.select(readers, (), (), delay)

    def _catch_up(self) -> None:
        now = self._clock.now
        behind = (now - self._emulator.now) / self._clock.speed
        if behind > MOST_BEHIND:
            _log.warning("%.1f s behind: the robot's clock stands still for them", behind)
            excess = (behind - MOST_BEHIND) * self._clock.speed
            self._clock.fall_back(excess)
            now -= excess
        self._emulator.advance(now)


class _Line:
    """One robot with its port and its side channel.

    Attributes:
        lost: bytes of clients that were dropped before they reached the line.
    """

    def __init__(
        self,
        emulator: Emulator,
        port: Port,
        follow_rate: bool,
        channel: SideChannel | None,
        log: WireLog | None,
    ) -> None:
        self.lost = 0
        self._emulator = emulator
        self._port = port
        self._follow_rate = follow_rate
        self._channel = channel
        self._log = channel.listening(log) if channel else log
        if self._log:
            emulator.uart.faults.listeners.append(self._log.fault)

    def descriptors(self) -> list[int]:
        """What becomes readable when a client or a query comes."""
        readers = list(self._port.descriptors(room=self._room() > 0))
        if self._channel:
            readers.append(self._channel.fileno())
        return readers

    def delay(self, clock: Clock) -> float:
        """Real seconds until something is due, at most `RESTING_PERIOD`."""
        delay = RESTING_PERIOD if self._room() else MOVING_PERIOD
        if self._channel:
            delay = min(delay, self._channel.delay())
        uart = self._emulator.uart
        request = uart.next_request()
        if request is not None:
            delay = min(delay, clock.delay(request))
        queued = uart.queued()
        if queued:
            first = clock.delay(uart.due(1)) + CHUNK
            delay = min(delay, first, clock.delay(uart.due(queued)))
        return delay

    def serve_client(self, catch_up: Callable[[], None]) -> None:
        """Take the client's bytes, come up to now, hand it the bytes that have reached it."""
        emulator, port = self._emulator, self._port
        chunks = port.receive(self._room())
        # the time is read after the bytes: none sets out before it was written
        catch_up()
        if chunks:
            self._receive(chunks)
        count = emulator.uart.arrived(emulator.now)
        # who has come since the look above must not get what was said to the one before
        if count and not port.changed():
            when = emulator.uart.due(count)
            reply = emulator.read()
            if self._log:
                self._log.reply(when, reply)
            port.write(reply)
        # a line without a rate has delivered already; the replies go next time round, after
        # another look at who is there
        if chunks:
            emulator.advance(emulator.now)

    def _receive(self, chunks: list[bytes]) -> None:
        emulator = self._emulator
        settings = self._port.settings()
        if self._log:
            self._log.line(emulator.now, settings)
        if not self._follow_rate:
            emulator.uart.client = settings
        elif settings:  # a port that tells nothing keeps the rate before
            emulator.uart.baud = settings.baud
        for chunk in chunks:
            if not chunk:
                if self._log:
                    self._log.close(emulator.now)
                emulator.hang_up()
                continue
            limit = _LEFT_BEHIND + (_TAKE if chunk is chunks[-1] else 0)
            fitting = chunk[: max(0, limit - emulator.uart.arriving())]
            self.lost += len(chunk) - len(fitting)
            if self._log:
                self._log.request(emulator.now, fitting)
            emulator.write(fitting)

    def serve_channel(self, catch_up: Callable[[], None]) -> None:
        """Answer one query and publish what is due."""
        if self._channel and self._channel.delay() <= 0.0:
            catch_up()
            self._channel.serve(self._emulator)

    def log_losses(self) -> None:
        """Say how many bytes were dropped."""
        _log.info(
            "%d bytes to clients that did not read and %d bytes from clients were dropped",
            self._port.dropped,
            self.lost + self._emulator.uart.lost,
        )

    def _room(self) -> int:
        uart = self._emulator.uart
        # garbled or lost bytes take their time on the line too
        if uart.received_by() - self._emulator.now > uart.wire_time(_TAKE):
            return 0
        return max(0, _TAKE - uart.arriving())
