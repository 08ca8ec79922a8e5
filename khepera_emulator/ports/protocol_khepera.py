r"""pySerial URL `khepera://ARENA?seed=N&...`: a whole robot inside the client's process.

Time is virtual and passes on the line: every byte takes its wire time, and a read lets time pass
up to the next byte or to its time-out. A program that waits by reading runs as fast as the
processor allows, with the same bytes each time.

    import serial, khepera_emulator
    port = serial.serial_for_url("khepera://corridor?seed=1", timeout=1)
    port.write(b"D,5,5\n"); port.readline()

Options after `?`, joined with `&`:
    seed=N         of all randomness (0)
    model=NAME     khepera or khepera2 (khepera)
    drift=SPEC     none, default, strong, or items such as scale=0.01,slip=0.05 (default)
    baud=unpaced   a line that takes no time; a number fixes the rate (the client's rate)

Not modelled: break conditions and modem lines are accepted and do nothing.
"""

from typing import Any
from urllib.parse import parse_qsl, urlsplit

from serial import SerialBase, SerialException, SerialTimeoutException
from serial.serialutil import PortNotOpenError

_OPTIONS = ("seed", "model", "drift", "baud")


class Serial(SerialBase):
    """A pySerial port with an emulated Khepera behind it.

    Beside the line it offers what a bench offers: `now` (the robot's clock in seconds),
    `emulator` (camera, ground truth, reset).
    """

    BAUDRATES = (9600, 19200, 38400, 57600, 115200)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self.emulator: Any = None
        self._fixed_rate = False
        super().__init__(*args, **kwargs)

    def open(self) -> None:
        """Switch the robot on."""
        if self.is_open:
            raise SerialException("Port is already open.")
        # pySerial swallows an ImportError at its look-up of URL schemes: import when opening
        from khepera_emulator.arena import load_arena
        from khepera_emulator.drift import parse_drift
        from khepera_emulator.emulator import Emulator, Setup
        from khepera_emulator.errors import EmulatorError
        from khepera_emulator.models import find_model

        arena, options = _split(str(self.portstr))
        rate = options.get("baud", "auto")
        self._fixed_rate = rate != "auto"
        try:
            setup = Setup(
                arena=load_arena(arena),
                model=find_model(options.get("model", "khepera")),
                drift=parse_drift(options.get("drift", "default")),
                seed=_whole("seed", options.get("seed", "0")),
                baud=None if rate in ("auto", "unpaced") else _whole("baud", rate),
            )
        except EmulatorError as error:
            raise SerialException(f"{self.portstr}: {error}") from None
        self.emulator = Emulator(setup)
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
        return float(self._open_emulator().now)

    @property
    def in_waiting(self) -> int:
        """Bytes that have arrived by now.

        Asking costs a tenth of a millisecond of virtual time, so that polling gets somewhere.
        """
        emulator = self._open_emulator()
        waiting = emulator.uart.arrived(emulator.now)
        if not waiting:
            emulator.advance(emulator.now + 1e-4)
            waiting = emulator.uart.arrived(emulator.now)
        return int(waiting)

    def read(self, size: int = 1) -> bytes:
        """Up to `size` bytes; time passes to their arrival, or to the time-out.

        Raises:
            SerialException: no time-out is set and nothing is on its way: a real port would wait
                for ever, and here nobody could ever write.
        """
        emulator = self._open_emulator()
        uart = emulator.uart
        deadline = None if self.timeout is None else emulator.now + self.timeout
        data = bytearray(emulator.read(size))
        while len(data) < size:
            event = uart.next_event()
            if event is None and deadline is None:
                raise SerialException(
                    "read without a time-out, and nothing is on its way: the robot speaks only"
                    " when asked; set a timeout"
                )
            if event is None or (deadline is not None and event > deadline):
                emulator.advance(max(emulator.now, deadline or emulator.now))
                break
            emulator.advance(max(emulator.now, event))
            data += emulator.read(size - len(data))
        return bytes(data)

    def write(self, b: Any, /) -> int:
        """Put bytes on the line; the robot receives them as time passes."""
        emulator = self._open_emulator()
        data = bytes(b)
        emulator.write(data)
        if self.write_timeout is not None and self.write_timeout < 0:
            raise SerialTimeoutException("Write timeout")
        return len(data)

    def flush(self) -> None:
        """Let time pass until everything written has arrived at the robot."""
        emulator = self._open_emulator()
        emulator.advance(max(emulator.now, emulator.uart.received_by()))

    def reset_input_buffer(self) -> None:
        """Drop what has arrived and was not read."""
        emulator = self._open_emulator()
        emulator.read()

    def reset_output_buffer(self) -> None:
        """Nothing to do: bytes are on the line as soon as they are written."""
        self._open_emulator()

    def _reconfigure_port(self, force_update: bool = False) -> None:  # noqa: ARG002 - pySerial's signature
        if self.is_open and not self._fixed_rate:
            self.emulator.uart.baud = self.baudrate

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
        emulator.advance(emulator.now + duration)

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


def _split(url: str) -> tuple[str, dict[str, str]]:
    parts = urlsplit(url)
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    unknown = [name for name in options if name not in _OPTIONS]
    if unknown:
        raise SerialException(
            f"{url}: unknown option {unknown[0]!r}; there are {', '.join(_OPTIONS)}"
        )
    return parts.netloc + parts.path, options


def _whole(name: str, text: str) -> int:
    if not text.isdecimal():
        raise SerialException(f"{name}={text} is not a whole number")
    return int(text)
