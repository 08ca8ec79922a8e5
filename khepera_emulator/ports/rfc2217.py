"""The robot's serial line as a telnet service after RFC 2217, for pySerial's `rfc2217://`.

The client's rate, data bits, parity and stop bits come with the bytes, as from a serial port
server. pySerial's `PortManager` speaks the telnet part. Modem lines, breaks and flow control are
acknowledged and do nothing: a Khepera has three wires. As on a UART with bytes still in its
buffer, new settings apply to what was written before them and has not set out yet.
"""

import logging
import socket
import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

from serial import rfc2217

from khepera_emulator.line.coding import PARITIES, LineFormat
from khepera_emulator.ports.tcp import TcpPort

_log = logging.getLogger(__name__)

_FIRST: Final = LineFormat(9600)
_BITS: Final = (5, 6, 7, 8)
_STOPS: Final = (1, 1.5, 2)
_FASTEST: Final = 10_000_000
_LONGEST_OPTION: Final = 64
"""Bytes of a telnet option; a longer one is no option, and is forgotten."""

_PENDING_LIMIT: Final = 4096
"""Bytes of commands that wait for a client that does not read; with more it is hung up."""


_MOST_REFUSALS: Final = 20
"""Refused settings of a client that are logged."""


class _Device:
    """The serial port that `PortManager` sets: it keeps the settings.

    Args:
        purge: called when the client wants what has not set out yet dropped.
        refused: told a setting that there is none of.
    """

    cts = dsr = ri = cd = False
    dtr = rts = True
    break_condition = xonxoff = rtscts = False

    def __init__(self, purge: Callable[[], None], refused: Callable[[str], None]) -> None:
        self.format = _FIRST
        self._purge = purge
        self._refused = refused

    def _refusal(self, setting: str) -> ValueError:
        self._refused(setting)
        return ValueError(setting)

    @property
    def baudrate(self) -> int:
        """Bits a second."""
        return self.format.baud

    @baudrate.setter
    def baudrate(self, rate: int) -> None:
        if not 0 < rate <= _FASTEST:
            raise self._refusal(f"a rate of {rate}")
        self.format = replace(self.format, baud=rate)

    @property
    def bytesize(self) -> int:
        """Data bits."""
        return self.format.bits

    @bytesize.setter
    def bytesize(self, bits: int) -> None:
        if bits not in _BITS:
            raise self._refusal(f"{bits} data bits")
        self.format = replace(self.format, bits=bits)

    @property
    def parity(self) -> str:
        """One of N, E, O, M and S."""
        return self.format.parity

    @parity.setter
    def parity(self, parity: str) -> None:
        if parity not in PARITIES:
            raise self._refusal(f"the parity {parity}")
        self.format = replace(self.format, parity=parity)

    @property
    def stopbits(self) -> float:
        """Stop bits: 1, 1.5 or 2."""
        return self.format.stop

    @stopbits.setter
    def stopbits(self, stop: float) -> None:
        if stop not in _STOPS:
            raise self._refusal(f"{stop} stop bits")
        self.format = replace(self.format, stop=stop)

    def reset_input_buffer(self) -> None:
        """Nothing to do: what the robot says is sent on at once."""

    def reset_output_buffer(self) -> None:
        """Drop what was read ahead of the line."""
        self._purge()


class _Writer:
    """The connection as `PortManager` knows it."""

    def __init__(self, put: Callable[[bytes], None]) -> None:
        self.write = put


class Rfc2217Port(TcpPort):
    """Server side of a serial line over telnet; arguments and errors as of `TcpPort`."""

    scheme = "rfc2217"

    def __init__(self, address: str, *, expose: bool = False) -> None:
        super().__init__(address, expose=expose)
        self._device = _Device(self._ahead.clear, self._refused)
        self._manager: rfc2217.PortManager | None = None
        self._pending = bytearray()
        self._after_return = False
        self._refusals = 0

    def settings(self) -> LineFormat | None:
        """Return what the client has set, or the one before it."""
        return self._device.format

    def receive(self, limit: int, *, answered: bool = True) -> list[bytes]:
        """Return what the client has done since the last call; an empty chunk: it has left."""
        self._flush()
        return super().receive(limit, answered=answered)

    def write(self, data: bytes) -> None:
        """Hand bytes to the client; never waits, and never leaves half a telnet command behind."""
        self._flush()
        if self._client is None:
            return
        escaped = data.replace(rfc2217.IAC, rfc2217.IAC_DOUBLED)
        taken = 0 if self._pending else self._send(escaped)
        rest = escaped[taken:]
        if _is_half(escaped[:taken]):
            self._pending += rest[:1]
            rest = rest[1:]
        self.dropped += len(rest.replace(rfc2217.IAC_DOUBLED, rfc2217.IAC))

    def _begin(self) -> None:
        self._pending.clear()
        self._after_return = False
        self._refusals = 0
        device: Any = self._device
        connection: Any = _Writer(self._put)
        self._manager = rfc2217.PortManager(device, connection)

    def _take_in(self, data: bytes) -> None:
        manager = self._manager
        assert manager is not None
        place = 0
        while place < len(data):
            if manager.mode == rfc2217.M_NORMAL and manager.suboption is None:
                command = data.find(rfc2217.IAC, place)
                end = command if command >= 0 else len(data)
                self._ahead += self._text(data[place:end])
                place = end
            self._ahead += self._part_of_command(manager, data[place : place + 1])
            place += 1

    def _text(self, text: bytes) -> bytes:
        """Return bytes outside commands; until the client has agreed on binary, CR NUL is CR."""
        if not text or (b"\r" not in text and not self._after_return) or self._is_binary():
            return text
        if self._after_return:
            text = text.removeprefix(b"\0")
        self._after_return = text.endswith(b"\r")
        return text.replace(b"\r\0", b"\r")

    def _is_binary(self) -> bool:
        manager: Any = self._manager
        options = manager._telnet_options
        return any(option.name == "they-BINARY" and option.active for option in options)

    def _part_of_command(self, manager: rfc2217.PortManager, byte: bytes) -> bytes:
        """Let a byte of a command take effect; returns what of it is meant for the robot."""
        try:
            out = b"".join(manager.filter(byte))
        except (ValueError, KeyError, TypeError, struct.error):
            # an option without its value, or with one that does not exist
            self._refused(f"the option {bytes(manager.suboption or b'').hex(' ')}")
            manager.mode, manager.suboption = rfc2217.M_NORMAL, None
            return b""
        if manager.suboption is not None and len(manager.suboption) > _LONGEST_OPTION:
            self._refused("an option without an end")
            manager.mode, manager.suboption = rfc2217.M_NORMAL, None
        return out

    def _refused(self, what: str) -> None:
        """Log what the client wants and does not get; of garbage the first few."""
        self._refusals += 1
        if self._refusals <= _MOST_REFUSALS:
            _log.info("%s: %s wants %s, which is refused", self.url, self._peer, what)

    def _put(self, data: bytes) -> None:
        """Send what can be sent of a command, keep the rest for later."""
        self._pending += data
        self._flush()
        if len(self._pending) > _PENDING_LIMIT:
            self._hang_up()

    def _flush(self) -> None:
        if self._pending and self._client:
            del self._pending[: self._send(bytes(self._pending))]

    def _hang_up(self) -> None:
        _log.info("%s: %s is hung up: it asks and does not read", self.url, self._peer)
        self._pending.clear()
        if self._client:
            with suppress(OSError):
                self._client.shutdown(socket.SHUT_RDWR)  # the next reading finds it gone


def _is_half(escaped: bytes) -> bool:
    """Tell whether escaped data is cut between the two bytes of an escape."""
    return (len(escaped) - len(escaped.rstrip(rfc2217.IAC))) % 2 == 1
