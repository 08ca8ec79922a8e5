"""Places where a robot is: every port of the emulator with both robots, or a physical one.

    pytest tests/conformance
    pytest tests/conformance --port /dev/ttyUSB0 --port-baud 9600

A physical robot is never driven: it may stand on a table.
"""

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest
from emulator_process import emulator
from robot_under_test import PATIENCE, Client, Place
from soaking import impatience

from khepera_emulator.app.daemon import Daemon
from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.line.clock import Clock
from khepera_emulator.models import find_model
from khepera_emulator.ports.rfc2217 import Rfc2217Port
from khepera_emulator.ports.tcp import TcpPort
from khepera_emulator.robot.emulator import Emulator, Setup

PORTS = ("pty", "socket", "rfc2217", "khepera")
MODELS = ("khepera", "khepera2")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--port", metavar="URL", help="a physical robot's port instead of emulators")
    parser.addoption("--port-baud", type=int, default=9600, help="its rate")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "place" in metafunc.fixturenames:
        physical = metafunc.config.getoption("--port", default=None)
        names = (
            ["hardware"] if physical else [f"{port}-{robot}" for port in PORTS for robot in MODELS]
        )
        metafunc.parametrize("place", names, indirect=True, scope="session")


@pytest.fixture(scope="session")
def place(request: pytest.FixtureRequest) -> Iterator[Place]:
    kind, _, model = request.param.partition("-")
    with ExitStack() as stack:
        stack.enter_context(impatience())
        if kind == "hardware":
            chosen = request.config.getoption
            made = Place(kind, "", chosen("--port"), chosen("--port-baud"))
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
def client(place: Place) -> Client:
    return place.client()


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
