"""Emulated robots that live in real time: one thread for their lines, clock and queries.

Everything happens between two waits, for one robot after the other: bytes go from the client to
the robot, physics comes up to now, bytes whose wire time has passed go to the client, and one
query is answered.
"""

import logging
from collections.abc import Callable

from khepera_protocol.system.supervisor import NOBODY, Supervisor
from khepera_protocol.system.waiting import readable

from khepera_emulator.app.control import Control
from khepera_emulator.app.side_channel import SideChannel
from khepera_emulator.line.clock import Clock, on_grid
from khepera_emulator.line.coding import LineFormat
from khepera_emulator.line.wire_log import WireLog
from khepera_emulator.line.wire_order import InOrder, WireListener
from khepera_emulator.ports.bell import Bell
from khepera_emulator.ports.port import Port
from khepera_emulator.robot.emulator import Emulator

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
    """Server of the emulated robots of one world, each on a port of its own.

    Args:
        emulator: one of the robots; time passes for all of them when it passes for one.
        clock: the time they live in; none of it has passed.
        control: takes requests of the program that has started this one, and ends the daemon with
            it.
        supervisor: waits for signs of life, if anybody does.
    """

    def __init__(
        self,
        emulator: Emulator,
        clock: Clock,
        control: Control | None = None,
        supervisor: Supervisor = NOBODY,
    ) -> None:
        self._supervisor = supervisor
        self._emulator = emulator
        self._clock = clock
        self._control = control
        self._lines: list[_Line] = []
        self._heard = False
        self._stopping = False
        self._stop = Bell()

    @property
    def lost(self) -> int:
        """Bytes of clients that were dropped before they reached a line."""
        return sum(line.lost for line in self._lines)

    def add(
        self,
        emulator: Emulator,
        port: Port,
        channel: SideChannel | None = None,
        log: WireLog | None = None,
        *,
        follow_rate: bool = True,
    ) -> None:
        """Serve a robot of the world.

        Args:
            emulator: the robot.
            port: its serial line.
            channel: camera, ground truth and reset.
            log: writes down what passes on the line.
            follow_rate: take the line's rate from the client's settings; otherwise a client with
                other settings than the robot's reads and sends garbage.
        """
        self._lines.append(_Line(emulator, port, follow_rate, channel, log))

    def stop(self) -> None:
        """End `run` soon; for signal handlers and other threads."""
        self._stopping = True
        self._stop.ring()

    def run(self) -> None:
        """Serve until `stop`."""
        try:
            while not self._stopping:
                self._supervisor.alive()
                self._serve(self._wait())
            self._serve(set())  # what came before the stop counts
        finally:
            self._supervisor.stopping()
            self._stop.close()
            for line in self._lines:
                line.end()

    def _wait(self) -> set[int]:
        """Sleep until a client, a query, a byte's wire time or a robot's motion wants something."""
        readers = [self._stop.fileno()]
        readers += [self._control.fileno()] if self._control else []
        # a robot that was talked to is hardly worth the question whether it moves
        awake = self._heard or self._emulator.moving
        delay = MOVING_PERIOD if awake else RESTING_PERIOD
        now = self._clock.now
        for line in self._lines:
            readers += line.descriptors()
            delay = min(delay, line.delay(now, self._clock.speed))
        return readable(readers, max(0.0, delay))

    def _serve(self, ready: set[int]) -> None:
        """Serve one round: bytes to the robots, time, bytes to the clients, queries."""
        for line in self._lines:
            line.look(ready)
        # the time is read after the bytes: none sets out before it was written
        now = self._time()
        self._heard = False
        for line in self._lines:
            self._heard |= line.take(now)
        self._emulator.reach(now)
        for line in self._lines:
            line.hand_over()
        for line in self._lines:
            line.tell(self._catch_up)
        if self._control and self._control.fileno() in ready:
            self._catch_up()
            if not self._control.serve():
                self.stop()

    def _catch_up(self) -> None:
        self._emulator.reach(self._time())

    def _time(self) -> float:
        """Now, on the robot's clock, which stands still if it could not keep up."""
        now = self._clock.now
        behind = (now - self._emulator.now) / self._clock.speed
        if behind > MOST_BEHIND:
            _log.warning("%.1f s behind: the robot's clock stands still for them", behind)
            excess = (behind - MOST_BEHIND) * self._clock.speed
            self._clock.fall_back(excess)
            now -= excess
        return max(self._emulator.now, on_grid(now))


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
        listeners: list[WireListener] = [channel.tap] if channel else []
        listeners += [log] if log else []
        self._log = InOrder(*listeners) if listeners else None
        self._chunks: list[bytes] = []
        self._watched: tuple[int, ...] = ()
        self._room = _TAKE
        self._answered = False
        self._look_again = False
        # a line that takes no time has no rate that a client's could differ from
        self._asks_settings = emulator.uart.dialect.serial and (
            follow_rate or emulator.uart.baud is not None or bool(self._log)
        )
        if self._log:
            emulator.uart.faults.listeners.append(self._log.fault)

    def descriptors(self) -> tuple[int, ...]:
        """Return what becomes readable when a client or a query comes."""
        self._room = self._emulator.uart.room(self._emulator.now, _TAKE)
        self._answered = self._emulator.uart.idle
        self._watched = self._port.descriptors(room=self._room > 0, answered=self._answered)
        return (*self._watched, self._channel.fileno()) if self._channel else self._watched

    def delay(self, now: float, speed: float) -> float:
        """Return real seconds until something is due, at most `RESTING_PERIOD`; may be negative."""
        delay = RESTING_PERIOD if self._room else MOVING_PERIOD
        if self._channel:
            delay = min(delay, self._channel.delay())
        uart = self._emulator.uart
        request = uart.next_request()
        if request is not None:
            delay = min(delay, (request - now) / speed)
        queued = uart.queued()
        if queued:
            first = (uart.due(1) - now) / speed + CHUNK
            delay = min(delay, first, (uart.due(queued) - now) / speed)
        return delay

    def look(self, ready: set[int]) -> None:
        """See what the client has done.

        Args:
            ready: descriptors that have become readable, of this line or of others; if there
                are none, some time has passed.
        """
        if not ready or self._look_again or not ready.isdisjoint(self._watched):
            self._look_again = False
            self._chunks = self._port.receive(self._room, answered=self._answered)

    def take(self, now: float) -> bool:
        """Put on the line, now, what the client has done; tells whether that is anything."""
        chunks = self._chunks
        if not chunks:
            return False
        self._chunks = []
        emulator, uart, log = self._emulator, self._emulator.uart, self._log
        # whatever was due before comes before: as when a log is replayed
        emulator.reach(now)
        if self._asks_settings:
            self._set(now, self._port.settings())
        for chunk in chunks:
            if not chunk:
                if log:
                    log.close(now)
                emulator.reach(now)
                emulator.hang_up()
                continue
            limit = _LEFT_BEHIND + (_TAKE if chunk is chunks[-1] else 0)
            room = max(0, limit - uart.arriving())
            fitting = chunk if len(chunk) <= room else _whole_requests(chunk[:room])
            self.lost += len(chunk) - len(fitting)
            if log:
                log.request(now, fitting)
            uart.receive(fitting, now)
        return True

    def _set(self, now: float, settings: LineFormat | None) -> None:
        uart = self._emulator.uart
        if self._log:
            self._log.line(now, settings)
        if not self._follow_rate:
            uart.client = settings
        elif settings:  # a port that tells nothing keeps the rate before
            uart.baud = settings.baud

    def hand_over(self) -> None:
        """Give the client the bytes that have reached it."""
        uart, port = self._emulator.uart, self._port
        count = uart.arrived(self._emulator.now)
        if not count:
            return
        reply = uart.waiting(count)
        # who has come since the last look must not get what was said to the one before: nothing
        # may come between this question and the writing
        if port.changed():
            self._look_again = True
            return
        port.write(reply)
        if self._log:
            self._log.reply(uart.due(count), reply)
        uart.take(count)

    def tell(self, catch_up: Callable[[], None]) -> None:
        """Tell those who watch what has passed, answer one query and publish what is due."""
        if self._log:
            self._log.pass_on(self._emulator.now)
        if self._channel and self._channel.delay() <= 0.0:
            catch_up()
            self._channel.serve(self._emulator)

    def end(self) -> None:
        """Tell the rest, and how many bytes were dropped."""
        if self._log:
            self._log.pass_on()
        url, uart = self._port.url, self._emulator.uart
        _log.info(
            "%s: %d bytes to clients that did not read and %d bytes of replies that the line had"
            " no room for were dropped",
            url,
            self._port.dropped,
            uart.unsent,
        )
        _log.info("%s: %d bytes from clients were dropped", url, self.lost + uart.lost)


def _whole_requests(data: bytes) -> bytes:
    """Return bytes up to the last whole request: whoever comes next would go on with half a one."""
    return data[: max(data.rfind(b"\n"), data.rfind(b"\r")) + 1]
