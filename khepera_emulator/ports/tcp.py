"""The robot's serial line on a TCP port, for pySerial's `socket://HOST:PORT` and for netcat.

One client at a time has the line, as one plug fits a robot; others are told so and turned away.
A connection carries bytes alone: no rate, no parity.

What a client sends is read ahead of the line, so that its goodbye is seen behind bytes that the
line has no room for yet. A client that has ended its sending side may still listen: it has the
line until its last reply is sent, unless another one comes.
"""

import logging
import socket
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Final, Self

from khepera_protocol.system.waiting import is_broken
from khepera_protocol.text import printable

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.coding import LineFormat
from khepera_emulator.ports.bell import Bell
from khepera_emulator.ports.port import PortRequest

_log = logging.getLogger(__name__)

_BACKLOG = 16
_SEND_BUFFER = 16 * 1024
"""Bytes that the system may hold for a client that does not read: what a pseudo-terminal holds."""

GRACE = 0.1
"""Seconds that a newcomer waits at the door: the goodbye of the one before may be overtaken."""

_LONG_GRACE: Final = 1.0
"""The same while the one before sends faster than the line takes it."""

_AHEAD = 8 * 1024 * 1024
"""Bytes of a client that are read ahead of the line, hours of it. A client that writes still more
waits, and gives way to another one: its goodbye could be behind what is not read yet."""

_PIECE = 16 * 1024
"""Bytes that are read at a time, so that other robots and the clock need not wait."""

_MOST_PORTS = 65535
_PORT_DIGITS = 5
_KEEP_ALIVE = (("TCP_KEEPIDLE", 20), ("TCP_KEEPINTVL", 5), ("TCP_KEEPCNT", 3))
"""A client whose machine has gone holds the line for 35 s at most."""


class TcpPort:
    """Server side of a TCP port.

    Args:
        address: HOST:PORT; port 0 takes any free one.
        expose: allow addresses that other machines can reach.

    Attributes:
        dropped: bytes to clients that did not fit because they do not read.

    Raises:
        EmulatorError: no such address, or it is taken, or it is not to be exposed.
    """

    scheme = "socket"

    def __init__(self, address: str, *, expose: bool = False) -> None:
        self.dropped = 0
        self._client: socket.socket | None = None
        self._peer = ""
        self._ahead = bytearray()
        self._heard = 0.0
        self._ended = False
        self._door: deque[_Newcomer] = deque()
        self._listener = _listen(address, expose=expose)
        # always readable: shown while there is something to say that no other descriptor tells
        self._ready = Bell()
        self._ready.ring()

    @classmethod
    def opened(cls, request: PortRequest) -> Self:
        """Listen at the address, or as many ports further on as the robot's number."""
        return cls(shifted(request.address, request.number), expose=request.expose)

    @property
    def url(self) -> str:
        """URL that a pySerial client opens."""
        return f"{self.scheme}://{_name(self._listener.getsockname())}"

    def close(self) -> None:
        """Hang up, and listen no more."""
        self._forget_client()
        for newcomer in self._door:
            newcomer.connection.close()
        self._listener.close()
        self._ready.close()

    def descriptors(self, *, room: bool, answered: bool = True) -> tuple[int, ...]:
        """Return descriptors that become readable when clients come, write or leave."""
        descriptors = [self._listener.fileno()]
        if self._client and not self._ended and len(self._ahead) < _AHEAD:
            descriptors.append(self._client.fileno())
        if (room and self._ahead) or self._is_done(answered):
            descriptors.append(self._ready.fileno())
        return tuple(descriptors)

    def settings(self) -> LineFormat | None:
        """Nothing: a bare connection has no rate."""
        return None

    def receive(self, limit: int, *, answered: bool = True) -> list[bytes]:
        """Return what the client has done since the last call; an empty chunk: it has left.

        A client that waits at the door takes the place of one that has left.
        """
        self._accept()
        chunks = self._listen_to_client(limit, answered)
        while self._door and not self._client:  # they may have left already
            self._admit(self._door.popleft())
            chunks += self._listen_to_client(limit, answered=False)
        while len(self._door) > _BACKLOG or (self._is_time_up() and not self._makes_room()):
            self._turn_away(self._door.popleft())
        return chunks

    def changed(self) -> bool:
        """Never: a connection leads to one client only."""
        return False

    def write(self, data: bytes) -> None:
        """Hand bytes to the client; never waits."""
        if self._client:
            self.dropped += len(data) - self._send(data)

    def _begin(self) -> None:
        """Begin with a client that has come."""

    def _take_in(self, data: bytes) -> None:
        """Put bytes for the robot, of what a client has sent, behind those that wait."""
        self._ahead += data

    def _send(self, data: bytes) -> int:
        """Put bytes on the connection; returns how many it took."""
        assert self._client is not None
        try:
            return self._client.send(data)
        except OSError:  # it is full, or broken, which the next reading tells
            return 0

    def _accept(self) -> None:
        """Let everybody who has come stand at the door."""
        with suppress(OSError):  # nobody there, or no longer
            while True:
                connection, peer = self._listener.accept()
                connection.setblocking(False)
                self._door.append(_Newcomer(connection, _name(peer), time.monotonic()))

    def _turn_away(self, newcomer: "_Newcomer") -> None:
        _log.info("%s: %s turned away: %s has the line", self.url, newcomer.peer, self._peer)
        with newcomer.connection as connection, suppress(OSError):
            connection.send(
                b"the robot's line is in use by %b: one client at a time\r\n" % self._peer.encode()
            )
            connection.recv(_PIECE)  # closing on unread bytes would take the line back

    def _admit(self, newcomer: "_Newcomer") -> None:
        connection, peer = newcomer.connection, newcomer.peer
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in _KEEP_ALIVE:
            if hasattr(socket, name):  # not on every system
                connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
        self._client, self._peer = connection, peer
        _log.info("%s: %s has the line", self.url, peer)
        self._begin()

    def _listen_to_client(self, limit: int, answered: bool) -> list[bytes]:
        """Return what the client has done since the last call, as `receive`."""
        if not self._client:
            return []
        self._read_ahead()
        left = False
        if self._makes_room():  # otherwise reading has told that it is there
            broken = self._is_broken()
            while broken and self._read_ahead():
                pass
            left = broken or self._is_time_up()
        taken = bytes(self._ahead) if left else bytes(self._ahead[: max(0, limit)])
        del self._ahead[: len(taken)]
        chunks = [taken] if taken else []
        if left or (not taken and self._is_done(answered)):
            self._forget_client()
            chunks.append(b"")
        return chunks

    def _read_ahead(self) -> bool:
        """Take a piece of what the client has sent; whether there was any, and room for it."""
        if not self._client or self._ended or len(self._ahead) >= _AHEAD:
            return False
        try:
            data = self._client.recv(_PIECE)
        except BlockingIOError:
            return False
        except OSError:  # broken
            data = b""
        self._heard = time.monotonic()
        self._ended = not data
        self._take_in(data)
        return bool(data)

    def _is_broken(self) -> bool:
        """Tell whether nobody is at the other end any more.

        Whoever closes without unread bytes breaks the connection only when something more is
        sent to it: until then it might be one that still listens.
        """
        assert self._client is not None
        return is_broken(self._client)

    def _makes_room(self) -> bool:
        """Tell whether the client may have left: it only listens, or its goodbye cannot be seen."""
        return self._ended or len(self._ahead) >= _AHEAD

    def _is_time_up(self) -> bool:
        """Tell whether somebody has waited at the door for long enough."""
        if not self._door:
            return False
        now = time.monotonic()
        # as long as more comes than the line takes, the goodbye may be behind that
        comes = bool(self._ahead) and not self._ended and now < self._heard + GRACE
        return now >= self._door[0].since + (_LONG_GRACE if comes else GRACE)

    def _is_done(self, answered: bool) -> bool:
        """Tell whether the client will send nothing more, and has been told all that it asked."""
        return self._ended and not self._ahead and answered

    def _forget_client(self) -> None:
        if self._client:
            _log.info("%s: %s has left", self.url, self._peer)
            self._client.close()
            self._client = None
        self._ahead.clear()
        self._ended = False


@dataclass(frozen=True, slots=True)
class _Newcomer:
    """A client at the door, and since when it has waited there."""

    connection: socket.socket
    peer: str
    since: float


def tcp_address(text: str) -> tuple[str, int]:
    """Return host and port of HOST:PORT; an IPv6 host stands in brackets.

    Raises:
        EmulatorError: it is neither.
    """
    host, _, port = text.rpartition(":")
    if host.startswith("[") and host.endswith("]"):
        host = host[1:-1]
    digits = port.isascii() and port.isdecimal() and len(port) <= _PORT_DIGITS
    if not (host and digits and int(port) <= _MOST_PORTS):
        raise EmulatorError(
            f"'{printable(text, 60)}' is no address; give HOST:PORT, such as 127.0.0.1:4000"
        )
    return host, int(port)


def shifted(address: str, places: int) -> str:
    """Return the address so many ports further on; port 0, any free one, stays.

    Raises:
        EmulatorError: it is no address, or there is no such port.
    """
    _, port = tcp_address(address)
    if not port or not places:
        return address
    if port + places > _MOST_PORTS:
        raise EmulatorError(f"{address}: there are no ports for {places + 1} robots from there on")
    return f"{address.rpartition(':')[0]}:{port + places}"


def _listen(address: str, *, expose: bool) -> socket.socket:
    host, port = tcp_address(address)
    try:
        family, kind, _, _, target = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        if not expose and not ip_address(target[0]).is_loopback:
            raise EmulatorError(
                f"{address} can be reached from other machines, and anybody there could drive the"
                " robot; give 127.0.0.1, or add --expose"
            )
        listener = socket.socket(family, kind)
    except (OSError, UnicodeError) as error:
        # a name with a label of more than 63 characters, or of none, cannot be encoded
        reason = error.strerror if isinstance(error, OSError) else "not the name of a machine"
        raise EmulatorError(f"no address {printable(address, 60)}: {reason}") from None
    try:
        listener.setblocking(False)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        listener.bind(target)
        listener.listen(_BACKLOG)
    except OSError as error:
        listener.close()
        raise EmulatorError(f"cannot listen on {address}: {error.strerror}") from None
    return listener


def _name(address: tuple[str | int, ...]) -> str:
    host, port = address[:2]
    return f"[{host}]:{port}" if ":" in str(host) else f"{host}:{port}"
