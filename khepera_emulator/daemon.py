"""An emulated robot that lives in real time: one thread for its line, its clock and its queries.

Everything happens between two waits: bytes go from the client to the robot, physics comes up to
now, bytes whose wire time has passed go to the client, and one query is answered.
"""

import logging
import os
import select
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
    """Serves one emulated robot on a port, and on a side channel if there is one.

    Args:
        emulator: the robot; its clock must not have begun.
        port: its serial line.
        clock: the time it lives in.
        follow_rate: take the line's rate from the client's settings; otherwise a client with
            other settings than the robot's reads and sends garbage.
        channel: camera, ground truth and reset.
        log: where to write down what passes on the line.

    Attributes:
        lost: bytes of clients that were dropped before they reached the line.
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
        self.lost = 0
        self._emulator = emulator
        self._port = port
        self._clock = clock
        self._follow_rate = follow_rate
        self._channel = channel
        self._log = log
        if log:
            emulator.uart.faults.listeners.append(log.fault)
        self._stopping = False
        self._stop = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)

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
                self._serve_line()
                self._serve_channel()
        finally:
            os.close(self._stop)
        _log.info(
            "%d bytes to clients that did not read and %d bytes from clients were dropped",
            self._port.dropped,
            self.lost + self._emulator.uart.lost,
        )

    def _wait(self) -> None:
        """Sleep until a client, a query, a byte's wire time or the robot's motion wants something.

        `select` keeps its time-out to a tenth of a millisecond; `poll` and `epoll` round it up
        to a whole one, half a character at 9600.
        """
        readers = [self._stop, *self._port.descriptors(room=self._room() > 0)]
        if self._channel:
            readers.append(self._channel.fileno())
        select.select(readers, (), (), self._delay())

    def _delay(self) -> float:
        """Real seconds until something is due."""
        moving = self._emulator.moving or not self._room()
        delay = MOVING_PERIOD if moving else RESTING_PERIOD
        if self._channel:
            delay = min(delay, self._channel.delay())
        uart = self._emulator.uart
        request = uart.next_request()
        if request is not None:
            delay = min(delay, self._clock.delay(request))
        queued = uart.queued()
        if queued:
            first = self._clock.delay(uart.due(1)) + CHUNK
            delay = min(delay, first, self._clock.delay(uart.due(queued)))
        return delay

    def _room(self) -> int:
        uart = self._emulator.uart
        # garbled or lost bytes take their time on the line too
        if uart.received_by() - self._emulator.now > uart.wire_time(_TAKE):
            return 0
        return max(0, _TAKE - uart.arriving())

    def _serve_line(self) -> None:
        emulator, port = self._emulator, self._port
        chunks = port.receive(self._room())
        # the time is read after the bytes: none sets out before it was written
        self._catch_up()
        if chunks:
            self._receive(chunks)
        count = emulator.uart.arrived(emulator.now)
        if count:
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

    def _serve_channel(self) -> None:
        if self._channel and self._channel.delay() <= 0.0:
            self._catch_up()
            self._channel.serve(self._emulator)

    def _catch_up(self) -> None:
        now = self._clock.now
        behind = (now - self._emulator.now) / self._clock.speed
        if behind > MOST_BEHIND:
            _log.warning("%.1f s behind: the robot's clock stands still for them", behind)
            excess = (behind - MOST_BEHIND) * self._clock.speed
            self._clock.fall_back(excess)
            now -= excess
        self._emulator.advance(now)
