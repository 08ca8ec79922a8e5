"""The robot's serial line on a TCP port, for pySerial's `socket://HOST:PORT` and for netcat.

One client at a time has the line, as one plug fits a robot; others are told so and turned away.
A connection carries bytes alone: no rate, no parity. A client has left when it ends its side of
the connection, even if it would still listen.
"""

import logging
import select
import socket
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Final

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line_coding import LineFormat

_log = logging.getLogger(__name__)

_BACKLOG = 16
_SEND_BUFFER = 16 * 1024
"""Bytes that the system may hold for a client that does not read: what a pseudo-terminal holds."""

GRACE = 0.1
"""Seconds that a newcomer waits at the door: the goodbye of the one before may be overtaken."""

_ALL = 1 << 16
_MOST_PORTS = 65535
_LOST: Final = select.POLLRDHUP | select.POLLHUP | select.POLLERR
_KEEP_ALIVE = ((socket.TCP_KEEPIDLE, 20), (socket.TCP_KEEPINTVL, 5), (socket.TCP_KEEPCNT, 3))
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
        self._door: deque[_Newcomer] = deque()
        self._listener = _listen(address, expose=expose)

    @property
    def url(self) -> str:
        """What a pySerial client opens."""
        return f"{self.scheme}://{_name(self._listener.getsockname())}"

    def close(self) -> None:
        """Hang up, and listen no more."""
        self._forget_client()
        for newcomer in self._door:
            newcomer.connection.close()
        self._listener.close()

    def descriptors(self, *, room: bool) -> tuple[int, ...]:
        """Descriptors that become readable when clients come, write or leave."""
        if self._client and room:
            return self._listener.fileno(), self._client.fileno()
        return (self._listener.fileno(),)

    def settings(self) -> LineFormat | None:
        """Nothing: a bare connection has no rate."""
        return None

    def receive(self, limit: int) -> list[bytes]:
        """What the client has done since the last call; an empty chunk: it has left.

        A client that waits at the door takes the place of one that has left.
        """
        chunks: list[bytes] = []
        self._accept()
        if self._door and self._client and self._has_left():
            chunks += [*self._take_rest(), b""]
            self._forget_client()
        self._look_at_door()
        if self._client and limit > 0:
            chunks += self._take(limit)
            self._look_at_door()
        return chunks

    def changed(self) -> bool:
        """Never: a connection leads to one client only."""
        return False

    def write(self, data: bytes) -> None:
        """Hand bytes to the client; never waits."""
        if self._client:
            self.dropped += len(data) - self._send(data)

    def _begin(self) -> None:
        """A client has come."""

    def _decode(self, data: bytes) -> bytes:
        """Bytes for the robot in what a client has sent."""
        return data

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
                self._door.append(_Newcomer(connection, _name(peer), time.monotonic() + GRACE))

    def _look_at_door(self) -> None:
        """Let the first one in if the line is free; turn away who has waited for too long."""
        if self._door and not self._client:
            self._admit(self._door.popleft())
        now = time.monotonic()
        while self._door and (self._door[0].until <= now or len(self._door) > _BACKLOG):
            self._turn_away(self._door.popleft())

    def _turn_away(self, newcomer: "_Newcomer") -> None:
        _log.info("%s turned away: %s has the line", newcomer.peer, self._peer)
        with newcomer.connection as connection, suppress(OSError):
            connection.send(
                b"the robot's line is in use by %b: one client at a time\r\n" % self._peer.encode()
            )
            connection.recv(_ALL)  # closing on unread bytes would take the line back

    def _admit(self, newcomer: "_Newcomer") -> None:
        connection, peer = newcomer.connection, newcomer.peer
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in _KEEP_ALIVE:
            connection.setsockopt(socket.IPPROTO_TCP, option, value)
        self._client, self._peer = connection, peer
        _log.info("%s has the line", peer)
        self._begin()

    def _take(self, limit: int) -> list[bytes]:
        assert self._client is not None
        try:
            data = self._client.recv(limit)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if data:
            taken = self._decode(data)
            return [taken] if taken else []
        self._forget_client()
        return [b""]

    def _take_rest(self) -> list[bytes]:
        assert self._client is not None
        data = b""
        with suppress(OSError):
            while len(data) < _ALL and (more := self._client.recv(_ALL)):
                data += more
        taken = self._decode(data)
        return [taken] if taken else []

    def _has_left(self) -> bool:
        """Whether the client has ended its side, whatever of it is still to be read."""
        assert self._client is not None
        poll = select.poll()
        poll.register(self._client, select.POLLRDHUP)
        return any(event & _LOST for _, event in poll.poll(0))

    def _forget_client(self) -> None:
        if self._client:
            _log.info("%s has left", self._peer)
            self._client.close()
            self._client = None


@dataclass(frozen=True, slots=True)
class _Newcomer:
    """A client at the door, and until when it may wait there."""

    connection: socket.socket
    peer: str
    until: float


def tcp_address(text: str) -> tuple[str, int]:
    """Host and port of HOST:PORT; an IPv6 host stands in brackets.

    Raises:
        EmulatorError: it is neither.
    """
    host, colon, port = text.rpartition(":")
    if not (colon and host and port.isascii() and port.isdecimal() and int(port) <= _MOST_PORTS):
        raise EmulatorError(f"{text!r} is no address; give HOST:PORT, such as 127.0.0.1:4000")
    return host.removeprefix("[").removesuffix("]"), int(port)


def shifted(address: str, places: int) -> str:
    """The address so many ports further on; port 0, any free one, stays.

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
    except OSError as error:
        raise EmulatorError(f"no address {address}: {error.strerror}") from None
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
