r"""pySerial URL `khepera://ARENA?seed=N&...`: a whole robot inside the client's process.

Time is virtual and passes on the line: every byte takes its wire time, and a read lets time pass
up to the next byte or to its time-out. A program that waits by reading runs as fast as the
processor allows, with the same bytes each time.

    import serial, khepera_emulator
    port = serial.serial_for_url("khepera://corridor?seed=1", timeout=1)
    port.write(b"N\n"); port.readline()

ARENA is a name, or the path of a TOML file; in a path, `%`, `#` and `?` are written as %25, %23
and %3F. Options after `?`, joined with `&`:
    seed=N         of all randomness (0)
    model=NAME     khepera or khepera2 (khepera)
    drift=SPEC     none, default, strong, or items such as scale=0.01,slip=0.05 (default)
    baud=unpaced   bytes take no time, and every write a millisecond: so a program that asks
                   until something has happened gets there; a number fixes the robot's rate:
                   with other settings the client reads and sends garbage (the client's rate)
    fault=SPEC     something that goes wrong on the line, repeatable; see
                   `khepera_emulator.line.faults`
    turret=NAME    gripper, k213, radio or general-io; repeatable
    robots=N       so many robots in one world, of which this line is that of robot=K (1 of 1);
                   nobody talks to the others
    firmware=NAME  a choice of `khepera_emulator.choices`, such as reject-beyond or
                   firmware=reached-within=2; repeatable
    dead-man=S     the robot stops by itself after so many seconds without a request (never)

Not modelled: break conditions and modem lines are accepted and do nothing.
"""

import re
from math import inf
from typing import Any
from urllib.parse import parse_qsl, unquote

from khepera_protocol.text import printable
from serial import SerialBase, SerialException
from serial.serialutil import PortNotOpenError

from khepera_emulator.line.clock import on_grid
from khepera_emulator.line.coding import LineFormat

_REPEATABLE = ("fault", "turret", "firmware")
_OPTIONS = ("seed", "model", "drift", "baud", "dead-man", "robots", "robot", *_REPEATABLE)
_DIGITS = 18
_FASTEST = 10_000_000
"""Bits a second: more than any serial line has."""

_SECONDS = re.compile(r"[0-9]{1,6}(\.[0-9]{0,9})?", re.ASCII)
_LEAST_DEAD_MAN = 0.01
_POLL_TIME = 1e-4
"""Seconds that asking for bytes takes when there are none, and nobody waits."""

_WRITE_TIME = on_grid(1e-3)
"""Seconds that a write takes on a line without wire time: otherwise time would stand still for a
program that asks and waits for the answer, and asks again."""


class Serial(SerialBase):
    """A pySerial port with an emulated Khepera behind it.

    Beside the line it offers what a bench offers: `now` (the robot's clock in seconds),
    `emulator` (camera, ground truth, reset).
    """

    BAUDRATES = (9600, 19200, 38400, 57600, 115200)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self.emulator: Any = None
        self._rate = "auto"
        self._wait: float | None = None
        super().__init__(*args, **kwargs)

    def open(self) -> None:
        """Switch the robot on."""
        if self.is_open:
            raise SerialException("Port is already open.")
        # pySerial swallows an ImportError at its look-up of URL schemes: import when opening
        from khepera_emulator.arenas.arena import MOST_ROBOTS, load_arena
        from khepera_emulator.body.drift import parse_drift
        from khepera_emulator.choices import parse_choices
        from khepera_emulator.errors import EmulatorError
        from khepera_emulator.line.faults import parse_faults
        from khepera_emulator.models import find_model
        from khepera_emulator.world.bullet import load_physics

        arena, options, lists = _split(str(self.portstr))
        self._rate = options.get("baud", "auto")
        try:
            load_physics()
            from khepera_emulator.robot.emulator import Setup, make_fleet
            from khepera_emulator.turrets import check_turrets

            setup = Setup(
                arena=load_arena(arena),
                model=find_model(options.get("model", "khepera")),
                drift=parse_drift(options.get("drift", "default")),
                seed=_whole("seed", options.get("seed", "0")),
                baud=_rate(self._rate),
                faults=parse_faults(lists["fault"]),
                turrets=check_turrets(lists["turret"]),
                choices=parse_choices(lists["firmware"]),
                dead_man=_dead_man(options.get("dead-man")),
            )
            robots = _whole("robots", options.get("robots", "1"), most=MOST_ROBOTS)
            robot = _whole("robot", options.get("robot", "1"), most=robots)
            self.emulator = make_fleet(setup, robots)[robot - 1]
        except EmulatorError as error:
            raise SerialException(
                f"{_shown(str(self.portstr))}: {printable(str(error), 1000)}"
            ) from None
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
        """Up to `size` bytes; time passes to their arrival, or to the time-out.

        Raises:
            SerialException: no time-out is set and nothing is on its way: a real port would wait
                for ever, and here nobody could ever write.
        """
        return self.read_until(b"", size)

    def read_until(self, expected: bytes = b"\n", size: int | None = None) -> bytes:
        """Bytes up to and with `expected`, at most `size` of them; fewer after the time-out.

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
        """A line with its line feed; fewer bytes after the time-out."""
        return self.read_until(size=None if size is None or size < 0 else size)

    def write(self, b: Any, /) -> int:
        """Put bytes on the line; the robot receives them as time passes."""
        data = b if type(b) is bytes else bytes(b)
        emulator = self._open_emulator()
        if emulator.uart.baud is None:
            emulator.advance(emulator.now + _WRITE_TIME)
        emulator.write(data)
        return len(data)

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
        if not self.is_open:
            return
        uart = self.emulator.uart
        if self._rate == "auto":
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
    """How many of the bytes that are queued make up what is waited for; 0 if they do not yet."""
    if expected:
        end: int = uart.find(expected) + len(expected)
        if end >= len(expected) and (size is None or end <= size):
            return end
    return size if size is not None and uart.queued() >= size else 0


def _split(url: str) -> tuple[str, dict[str, str], dict[str, list[str]]]:
    """Arena, options, and the values of repeatable options of a URL."""
    arena, _, query = url.partition("://")[2].partition("?")
    pairs = parse_qsl(query, keep_blank_values=True)
    options = dict(pairs)
    unknown = [name for name in options if name not in _OPTIONS]
    if unknown:
        raise SerialException(
            f"{_shown(url)}: unknown option '{_shown(unknown[0])}'; there are {', '.join(_OPTIONS)}"
        )
    lists = {option: [v for name, v in pairs if name == option] for option in _REPEATABLE}
    return unquote(arena, errors="surrogateescape"), options, lists


def _whole(name: str, text: str, most: int | None = None) -> int:
    """A whole number; with a limit one from 1 to it."""
    if not (text.isascii() and text.isdecimal() and len(text) <= _DIGITS):
        raise SerialException(
            f"{name}='{_shown(text)}' is not a whole number of up to {_DIGITS} digits"
        )
    if most is not None and not 1 <= int(text) <= most:
        raise SerialException(f"{name}={text} is not from 1 to {most}")
    return int(text)


def _dead_man(text: str | None) -> float | None:
    """Seconds that an option gives; None: never."""
    if text is None:
        return None
    if not _SECONDS.fullmatch(text) or float(text) < _LEAST_DEAD_MAN:
        raise SerialException(
            f"dead-man='{_shown(text)}' is no number of seconds of at least {_LEAST_DEAD_MAN}"
        )
    return float(text)


def _rate(text: str) -> int | None:
    """Rate in bits a second that an option fixes; None for none."""
    if text in ("auto", "unpaced"):
        return None
    if not text.strip("0") and text:
        raise SerialException("baud=0 is no rate; give bits a second, or unpaced")
    return _whole("baud", text, most=_FASTEST)


def _shown(text: str) -> str:
    return printable(text, 100)
