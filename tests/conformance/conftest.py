"""Places where a robot is: every port of the emulator with both robots, or a physical one.

    pytest tests/conformance
    pytest tests/conformance --port /dev/ttyUSB0 --port-baud 9600

A physical robot is never driven: it may stand on a table.
"""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from emulator_process import emulator
from robot_under_test import Client, Place, served
from soaking import impatience

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
