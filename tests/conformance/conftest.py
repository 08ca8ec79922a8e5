"""Places where a robot is: every port of the emulator with both robots, or a physical one.

    pytest tests/conformance
    pytest tests/conformance --port /dev/ttyUSB0 --port-baud 9600

A physical robot is never driven: it may stand on a table.
"""

import threading
import time
from contextlib import ExitStack, contextmanager
from itertools import count
from types import SimpleNamespace

import pytest
import serial
import serial.rfc2217
import serial.urlhandler.protocol_socket
from emulator_process import emulator

import khepera_emulator  # noqa: F401 - registers khepera://
from khepera_emulator.app.daemon import Daemon
from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.line.clock import Clock
from khepera_emulator.models import find_model
from khepera_emulator.ports.rfc2217 import Rfc2217Port
from khepera_emulator.ports.tcp import TcpPort
from khepera_emulator.robot.emulator import Emulator, Setup

PORTS = ("pty", "socket", "rfc2217", "khepera")
MODELS = ("khepera", "khepera2")
PATIENCE = 10.0


def pytest_addoption(parser):
    parser.addoption("--port", metavar="URL", help="a physical robot's port instead of emulators")
    parser.addoption("--port-baud", type=int, default=9600, help="its rate")


def pytest_generate_tests(metafunc):
    if "place" in metafunc.fixturenames:
        physical = metafunc.config.getoption("--port", default=None)
        names = (
            ["hardware"] if physical else [f"{port}-{robot}" for port in PORTS for robot in MODELS]
        )
        metafunc.parametrize("place", names, indirect=True, scope="session")


class Client:
    """A program at a robot's port, which may be opened anew."""

    def __init__(self, place):
        self.port = serial.serial_for_url(place.url, baudrate=place.baud, timeout=PATIENCE)
        self.write = self.port.write
        self.read = self.port.read
        self.line = lambda: self.port.read_until(b"\n")

    def ask(self, request):
        self.write(request)
        return self.line()

    def silence(self, seconds=0.05):
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

    def __init__(self, kind, model, url, baud=9600):
        self.kind, self.model, self.url, self.baud = kind, model, url, baud
        self.keeps = kind != "khepera"
        self._client = None

    def open(self):
        """A new client, in the place of the one there was."""
        self.close()
        self._client = Client(self)
        return self._client

    def close(self):
        if self._client:
            self._client.port.close()
            self._client = None

    def client(self):
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
def impatience():
    """pySerial's network ports sleep a third of a second at every closing: a thousandth will do."""
    quick = SimpleNamespace(sleep=lambda seconds: time.sleep(min(seconds, 0.001)), time=time.time)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(serial.urlhandler.protocol_socket, "time", quick)
        patch.setattr(serial.rfc2217, "time", quick)
        yield


@pytest.fixture(scope="session")
def place(request):
    kind, _, model = request.param.partition("-")
    with ExitStack() as stack:
        stack.enter_context(impatience())
        if kind == "hardware":
            options = request.config.getoption
            made = Place(kind, "", options("--port"), options("--port-baud"))
        elif kind == "khepera":
            made = Place(kind, model, f"khepera://corridor?model={model}")
        elif kind == "pty":
            # a process of its own: the clients of this one must not stop it between two steps
            options = ("--no-zenoh", "--baud", "unpaced", "--model", model)
            made = Place(kind, model, stack.enter_context(emulator(*options)).path)
        else:
            made = Place(kind, model, stack.enter_context(served(kind, model)))
        stack.callback(made.close)
        yield made


@pytest.fixture
def client(place):
    return place.client()


@contextmanager
def served(kind, model):
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
