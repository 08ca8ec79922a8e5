r"""pySerial URL `khepera://ARENA?seed=N&...`: a whole robot inside the client's process.

Time is virtual and passes on the line: every byte takes its wire time, and a read lets time pass
up to the next byte or to its time-out. A program that waits by reading runs as fast as the
processor allows, with the same bytes each time.

    import serial, khepera_emulator
    port = serial.serial_for_url("khepera://corridor?seed=1", timeout=1)
    port.write(b"N\n"); port.readline()

ARENA is a name, or the path of a TOML file; in a path, `%`, `#` and `?` are written as %25, %23
and %3F. Without ARENA it is the corridor. The options after `?`, joined with `&`, are those of
`khepera-emulator run` that make a robot, `robots=N&robot=K` for one of several in a world: see
docs/commands.md. Three differ in a process without real time:
    baud=unpaced   bytes take no time, and every write a millisecond: so a program that asks
                   until something has happened gets there
    baud=N         with other settings the client reads and sends garbage
    robots=N       nobody talks to the others

Not modelled: break conditions and modem lines are accepted and do nothing.
"""

from collections.abc import Collection
from math import inf
from typing import Any

from khepera_protocol.text import printable
from serial import SerialBase, SerialException
from serial.serialutil import PortNotOpenError

from khepera_emulator.line.clock import WRITE_TIME, on_grid
from khepera_emulator.line.coding import LineFormat

_POLL_TIME = 1e-4
"""Seconds that asking for bytes takes when there are none, and nobody waits."""


class Serial(SerialBase):
    """A pySerial port with an emulated Khepera behind it.

    Beside the line it offers what a bench offers: `now` (the robot's clock in seconds),
    `emulator` (camera, ground truth, reset).

    Attributes:
        allowed: parts named by a file or module that the URL may use: code that runs. A URL may
            come from anywhere, so there are none unless they are set before it is opened.
    """

    BAUDRATES = (9600, 19200, 38400, 57600, 115200)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self.emulator: Any = None
        self.allowed: Collection[str] = ()
        self._follows = True
        self._wait: float | None = None
        super().__init__(*args, **kwargs)

    def open(self) -> None:
        """Switch the robot on."""
        if self.is_open:
            raise SerialException("Port is already open.")
        # pySerial swallows an ImportError at its look-up of URL schemes: import when opening
        from khepera_protocol.options import OptionError

        from khepera_emulator.errors import EmulatorError
        from khepera_emulator.robot.emulator import make_robots
        from khepera_emulator.robot.options import AUTO, UrlOptions

        url = str(self.portstr)
        try:
            options = UrlOptions.from_url(url)
            self.emulator = make_robots(options.setups(self.allowed))[options.robot - 1]
            self._follows = options.baud == AUTO
        except (EmulatorError, OptionError) as error:
            raise SerialException(f"{printable(url, 100)}: {printable(str(error), 1000)}") from None
        self.is_open = True
        self._reconfigure_port()

    def close(self) -> None:
        """Switch the robot off."""
        if self.is_open:
            self.is_open = False
            self.emulator.close()

    @property
    def now(self) -> float:
        """The robot's clock: seconds of virtual time since the port was opened."""
        if not self.is_open:
            raise PortNotOpenError()
        now: float = self.emulator.now
        return now

    @property
    def in_waiting(self) -> int:
        """Bytes that have arrived by now.

        Asking costs a tenth of a millisecond of virtual time, so that polling gets somewhere.
        """
        emulator = self._open_emulator()
        waiting = emulator.uart.arrived(emulator.now)
        if not waiting:
            emulator.advance(emulator.now + on_grid(_POLL_TIME))
            waiting = emulator.uart.arrived(emulator.now)
        return int(waiting)

    def read(self, size: int = 1) -> bytes:
        """Read up to `size` bytes; time passes to their arrival, or to the time-out.

        Raises:
            SerialException: no time-out is set and nothing is on its way: a real port would wait
                for ever, and here nobody could ever write.
        """
        return self.read_until(b"", size)

    def read_until(self, expected: bytes = b"\n", size: int | None = None) -> bytes:
        """Read bytes up to and with `expected`, at most `size` of them; fewer after the time-out.

        Without `expected` it is their number that counts.

        Raises:
            SerialException: as for `read`.
        """
        if size == 0:
            return b""
        emulator = self._open_emulator()
        uart, wait = emulator.uart, self._wait
        deadline = inf if wait is None else emulator.now + wait
        while not (count := _complete(uart, expected, size)):
            event = uart.next_request()
            if event is None and wait is None:
                raise SerialException(
                    "read without a time-out, and nothing is on its way: the robot speaks only"
                    " when asked; set a timeout"
                )
            if event is None or event > deadline:
                break
            emulator.reach(event)
        if count and (due := uart.due(count)) <= deadline:
            emulator.reach(due)
            size = count
        else:
            emulator.reach(deadline)
        taken: bytes = uart.sent(emulator.now, size)
        return taken

    def readline(self, size: int | None = -1, /) -> bytes:
        """Read a line with its line feed; fewer bytes after the time-out."""
        return self.read_until(size=None if size is None or size < 0 else size)

    def write(self, b: Any, /) -> int:
        """Put bytes on the line; the robot receives them as time passes."""
        data = b if type(b) is bytes else bytes(b)
        emulator = self._open_emulator()
        if emulator.uart.baud is None:
            emulator.advance(emulator.now + WRITE_TIME)
        emulator.write(data)
        return len(data)

    def watch(self, limit: int, until: float) -> Any:
        """Ask for the proximity sensors again and again, as a client does by N, but all at once.

        What comes of it is the same to the last bit.

        Args:
            limit: counts of one of the six sensors at front and sides that end it.
            until: time on this port's clock that ends it.

        Returns:
            See `robot.compiled.watcher.Watched`; None if the client has to ask by itself.
        """
        return self._open_emulator().watch(limit, until)

    def drive(self, *arc: Any) -> Any:
        """Drive an arc as a client does, but all at once: J, C, N and K until it is over, D, H.

        What comes of it is the same to the last bit.

        Args:
            arc: see `robot.compiled.watcher.Arc`.

        Returns:
            See `robot.compiled.watcher.Driven`; None if the client has to ask by itself.
        """
        from khepera_emulator.robot.compiled.watcher import Arc

        return self._open_emulator().drive(Arc(*arc))

    def flush(self) -> None:
        """Let time pass until everything written has arrived at the robot."""
        emulator = self._open_emulator()
        emulator.advance(emulator.uart.received_by())

    def reset_input_buffer(self) -> None:
        """Drop what has arrived and was not read."""
        emulator = self._open_emulator()
        emulator.read()

    def reset_output_buffer(self) -> None:
        """Nothing to do: bytes are on the line as soon as they are written."""
        self._open_emulator()

    def _reconfigure_port(self, force_update: bool = False) -> None:  # noqa: ARG002 - pySerial's signature
        # without waiting a tenth of a millisecond passes, so that polling gets somewhere
        timeout = self.timeout
        self._wait = None if timeout is None else on_grid(max(timeout, _POLL_TIME))
        if not self.is_open or not self.emulator.uart.dialect.serial:
            return
        uart = self.emulator.uart
        if self._follows:
            if uart.baud != self.baudrate:
                uart.baud = self.baudrate
        else:
            settings = (self.bytesize, self.parity, self.stopbits)
            # a rate of 0 is none: the client has hung up
            uart.client = LineFormat(self.baudrate, *settings) if self.baudrate else None

    def _open_emulator(self) -> Any:
        if not self.is_open:
            raise PortNotOpenError()
        return self.emulator

    def _update_rts_state(self) -> None:
        """No such line."""

    def _update_dtr_state(self) -> None:
        """No such line."""

    def _update_break_state(self) -> None:
        """No such condition."""

    def send_break(self, duration: float = 0.25) -> None:
        """Let the time of the break pass."""
        emulator = self._open_emulator()
        emulator.advance(emulator.now + on_grid(duration))

    @property
    def cts(self) -> bool:
        """No such line: never set."""
        return False

    @property
    def dsr(self) -> bool:
        """No such line: never set."""
        return False

    @property
    def ri(self) -> bool:
        """No such line: never set."""
        return False

    @property
    def cd(self) -> bool:
        """No such line: never set."""
        return False


def _complete(uart: Any, expected: bytes, size: int | None) -> int:
    """Count the queued bytes that make up what is waited for; 0 if they do not yet."""
    if expected:
        end: int = uart.find(expected) + len(expected)
        if end >= len(expected) and (size is None or end <= size):
            return end
    return size if size is not None and uart.queued() >= size else 0
