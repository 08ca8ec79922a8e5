"""The behaviour of e-pucks on every port, to the byte, whatever their clients are used to."""

from collections.abc import Iterator
from contextlib import ExitStack
from itertools import count

import pytest
import serial
from emulator_process import emulator
from khepera_protocol.epuck import codes
from khepera_protocol.epuck.letters import reply_numbers
from khepera_protocol.epuck.packets import Actuators, AllSensors
from robot_under_test import PATIENCE, served

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

PLACES = ("pty-epuck2", "socket-epuck", "rfc2217-epuck2", "khepera-epuck", "khepera-epuck2")
VERSIONS = {
    "epuck": b"v,Version 1.2.2 August 2008 GCtronic\r\nHW version: FFF7\r\n",
    "epuck2": b"v,Version 2.0 January 2018 GCtronic\r\nHW version: FFF7\r\n",
}
ENDS = pytest.mark.parametrize("end", [b"\r", b"\n", b"\r\n"], ids=["CR", "LF", "CRLF"])


class Client:
    """A program at an e-puck's port."""

    def __init__(self, model: str, url: str) -> None:
        self.model = model
        self.port = serial.serial_for_url(url, baudrate=115_200, timeout=PATIENCE)
        self._marks = count(1)

    def settle(self) -> None:
        """Bring the robot to rest, whatever was begun."""
        mark = next(self._marks)
        self.port.write(b"\0" * 40 + b"\r\rD,0,0\rP,%d,0\rQ\r" % mark)
        while (line := self.port.read_until(b"\n")) != b"q,%d,0\r\n" % mark:
            assert line, "the robot does not answer"

    def ask(self, request: bytes) -> bytes:
        self.port.write(request)
        return self.port.read_until(b"\n")


@pytest.fixture(scope="module", params=PLACES)
def robot(request: pytest.FixtureRequest) -> Iterator[Client]:
    kind, _, model = request.param.partition("-")
    with ExitStack() as stack:
        if kind == "khepera":
            url = f"khepera://corridor?model={model}"
        elif kind == "pty":
            options = ("--no-zenoh", "--baud", "unpaced", "--model", model)
            url = stack.enter_context(emulator(*options)).path
        else:
            url = stack.enter_context(served(kind, model))
        client = Client(model, url)
        stack.callback(client.port.close)
        yield client


@pytest.fixture
def client(robot: Client) -> Client:
    robot.settle()
    return robot


@ENDS
def test_each_line_end_makes_one_request(client: Client, end: bytes) -> None:
    client.port.write(b"P,1,2" + end + b"Q" + end + b"D,0,0" + end)
    assert client.port.read(len(b"p\r\nq,1,2\r\nd\r\n")) == b"p\r\nq,1,2\r\nd\r\n"


def test_versions(client: Client) -> None:
    client.port.write(b"V\r")
    expected = VERSIONS[client.model]
    assert client.port.read(len(expected)) == expected


def test_unknown_letters_are_refused(client: Client) -> None:
    assert client.ask(b"!\r") == b"z,Command not found\r\n"


@pytest.mark.parametrize(("letter", "values"), [("A", 3), ("N", 8), ("O", 8), ("U", 3), ("I", 5)])
def test_letters_give_so_many_numbers(client: Client, letter: str, values: int) -> None:
    line = client.ask(letter.encode() + b"\r")
    assert len(reply_numbers(letter, line[:-2])) == values


def test_every_byte_passes_in_a_row(client: Client) -> None:
    for low in range(0, 256, 5):
        value = low | ((low + 3) % 256) << 8
        client.port.write(codes.row(("P", codes.pack([value, value])), "Q"))
        assert client.port.read(4) == codes.pack([value, value])


def test_a_row_may_come_in_pieces(client: Client) -> None:
    data = codes.row(("P", codes.pack([13, 10])), "Q", "E")
    for cut in range(1, len(data)):
        client.port.write(data[:cut])
        client.port.flush()
        client.port.write(data[cut:])
        assert client.port.read(8)[:4] == codes.pack([13, 10])


def test_text_and_rows_take_turns(client: Client) -> None:
    client.port.write(b"P,5,6\r" + codes.row("Q") + b"Q\r" + codes.row("Q"))
    expected = b"p\r\n\x05\x00\x06\x00q,5,6\r\n\x05\x00\x06\x00"
    assert client.port.read(len(expected)) == expected


def test_a_picture_comes_whole(client: Client) -> None:
    assert client.ask(b"J,1,40,40,8\r") == b"j\r\n"
    client.port.write(codes.row("I"))
    assert client.port.read(3203)[:3] == b"\x01\x28\x28"


def test_all_actuators_and_all_sensors(client: Client) -> None:
    if client.model != "epuck2":
        pytest.skip("an e-puck2's")
    client.port.write(codes.row((0xF7, Actuators().pack()), 0xF8))
    assert AllSensors.unpack(client.port.read(103)).selector == 3


def test_the_robot_says_nothing_unasked(client: Client) -> None:
    client.port.timeout = 0.05
    try:
        assert client.port.read(100) == b""
    finally:
        client.port.timeout = PATIENCE
