"""Messages to a supervisor that waits for them: systemd, for a unit of `Type=notify`.

The protocol is that of sd_notify(3): lines such as `READY=1` in a datagram to the socket that the
environment names. Without one nothing is sent. A watchdog is fed by the loop that does the work,
and by no thread beside it: where the loop hangs, the supervisor is to see that.
"""

import os
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from math import inf
from typing import Final, Self

_SHARE: Final = 4
"""Signs of life within the time of the watchdog."""

_MICRO: Final = 1e-6


class Supervisor:
    """Whoever has started this program and waits for its signs of life, or nobody.

    Args:
        address: of the socket; a name that begins with @ is one without a file. Empty: nobody.
        period: seconds between two signs of life; infinite: none are wanted.
    """

    def __init__(self, address: str = "", period: float = inf) -> None:
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._period = period
        self._last = -inf
        self._socket: socket.socket | None = None

    @classmethod
    def of(cls, environment: Mapping[str, str]) -> Self:
        """Return the supervisor that an environment tells of."""
        address = environment.get("NOTIFY_SOCKET", "")
        limit = environment.get("WATCHDOG_USEC", "")
        meant = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        wanted = meant and limit.isdecimal() and int(limit) > 0
        return cls(address, int(limit) * _MICRO / _SHARE if wanted else inf)

    def ready(self, status: str) -> None:
        """Tell that the program has begun its work, and what that is."""
        self._send("READY=1", f"STATUS={_line(status)}")

    def status(self, text: str) -> None:
        """Tell what the program does."""
        self._send(f"STATUS={_line(text)}")

    def alive(self) -> None:
        """Give a sign of life, if it is time for one; for loops that go round often."""
        if self._period == inf:
            return
        now = time.monotonic()
        if now - self._last >= self._period:
            self._last = now
            self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """Tell that the program ends."""
        self._send("STOPPING=1")

    def _send(self, *lines: str) -> None:
        if not self._address:
            return
        with suppress(OSError):  # a supervisor that has gone, or does not read, changes nothing
            if self._socket is None:
                self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
                self._socket.setblocking(False)
            self._socket.sendto("\n".join(lines).encode(), self._address)


def _line(text: str) -> str:
    return " ".join(text.split())


NOBODY: Final = Supervisor()
"""No supervisor: nothing is sent."""
