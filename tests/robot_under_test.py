"""A robot that the conformance tests talk to: where it is, and the program at its port."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

import serial

from khepera_emulator.app.daemon import Daemon
from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.line.clock import Clock
from khepera_emulator.models import find_model
from khepera_emulator.ports.rfc2217 import Rfc2217Port
from khepera_emulator.ports.tcp import TcpPort
from khepera_emulator.robot.emulator import Emulator, Setup

PATIENCE = 10.0


class Client:
    """A program at a robot's port, which may be opened anew."""

    def __init__(self, place: "Place") -> None:
        self.port = serial.serial_for_url(place.url, baudrate=place.baud, timeout=PATIENCE)
        self.write = self.port.write
        self.read = self.port.read

    def line(self) -> bytes:
        return self.port.read_until(b"\n")

    def ask(self, request: bytes) -> bytes:
        self.write(request)
        return self.line()

    def silence(self, seconds: float = 0.05) -> bytes:
        """Return what comes without being waited for."""
        self.port.timeout = seconds
        try:
            return self.read(1000)
        finally:
            self.port.timeout = PATIENCE


class Place:
    """The place of a robot.

    Attributes:
        kind: pty, socket, rfc2217, khepera (in-process) or hardware.
        model: which robot; empty for a physical one, of which that is not known.
        keeps: whether a robot outlives its clients.
    """

    _marks = count(1)

    def __init__(self, kind: str, model: str, url: str, baud: int = 9600) -> None:
        self.kind, self.model, self.url, self.baud = kind, model, url, baud
        self.keeps = kind != "khepera"
        self._client: Client | None = None

    def open(self) -> Client:
        """A new client, in the place of the one there was."""
        self.close()
        self._client = Client(self)
        return self._client

    def close(self) -> None:
        if self._client:
            self._client.port.close()
            self._client = None

    def client(self) -> Client:
        """A client whose robot has nothing more to say, at rest."""
        client = self._client or self.open()
        mark = next(self._marks)
        # one request at a time, as clients do that follow another one
        for request, reply in (
            (b"\nG,%d,0\n" % mark, b"g\r\n"),
            (b"H\n", b"h,%d,0\r\n" % mark),
            (b"D,0,0\n", b"d\r\n"),
        ):
            client.write(request)
            while (line := client.line()) != reply:
                assert line, "the robot does not answer"
        return client


@contextmanager
def served(kind: str, model: str) -> Iterator[str]:
    """A daemon in a thread of its own; gives the URL of its port."""
    make = TcpPort if kind == "socket" else Rfc2217Port
    port = make("127.0.0.1:0")
    emulator = Emulator(Setup(load_arena("corridor"), model=find_model(model), baud=None))
    daemon = Daemon(emulator, Clock())
    daemon.add(emulator, port, follow_rate=False)
    thread = threading.Thread(target=daemon.run)
    thread.start()
    try:
        yield port.url
    finally:
        daemon.stop()
        thread.join(PATIENCE)
        port.close()
        emulator.close()
