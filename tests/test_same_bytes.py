"""The same seed gives the same bytes, pictures and places in every process and on every port.

As far as they do not hang on when a request comes: what is asked of a robot at rest. Its wheels
come to rest where they do whenever the order to turn arrives, because all goes by control periods;
only what it says on the way is a matter of time.
"""

import re
import subprocess
import sys
from hashlib import sha256

import pytest
import serial
from emulator_process import PATIENCE, emulator, free_endpoint
from in_process import open_robot

import khepera_emulator  # noqa: F401 - registers khepera://
from macor_hil.hardware.bench import PortBench, ZenohBench
from macor_hil.hardware.cameras import open_camera
from macor_hil.hardware.cameras.camera import Camera
from macor_hil.telemetry.session import open_session

ARENA = "open-box"
MOVES = (b"C,700,500", b"J,40,128,30,64", b"C,200,1100", b"G,5,-7", b"C,1500,-300")
ASKED = (b"H", b"N", b"O", b"N", b"E", b"K", b"B", b"I,0")
REACHED = re.compile(rb"k,1,[01],0,1,[01],0\r\n")

IN_PROCESS = """
import sys
sys.path.insert(0, sys.argv[1])
from test_same_bytes import in_process
print(in_process(int(sys.argv[2])))
"""


def ask(port: serial.SerialBase, request: bytes) -> bytes:
    port.write(request + b"\n")
    reply = port.read_until(b"\n")
    assert reply.endswith(b"\n")
    return reply


def stand(port: serial.SerialBase, bench: PortBench | ZenohBench) -> None:
    """Wait until the wheels are where they shall be, and stand: then they stand for good."""
    while not (
        REACHED.fullmatch(ask(port, b"K"))
        and ask(port, b"E") == b"e,0,0\r\n"
        and bench.truth().speed == (0.0, 0.0)
    ):
        pass


def session(port: serial.SerialBase, bench: PortBench | ZenohBench, camera: Camera) -> str:
    """All that a robot says, shows and is, at rest between moves."""
    seen: list[object] = []
    for move in MOVES:
        seen.append(ask(port, move))
        stand(port, bench)
        seen += [ask(port, request) for request in ASKED]
        seen.append(sha256(camera.grab().image.tobytes()).hexdigest())
        truth = bench.truth()
        seen += [truth.pose, truth.speed, truth.contact, truth.touched, truth.drift]
    return sha256(repr(seen).encode()).hexdigest()


def in_process(seed: int) -> str:
    url = f"khepera://{ARENA}?seed={seed}"
    with open_robot(url, baudrate=9600, timeout=2) as port:
        camera = open_camera("port", port=port, session=None, robot="khepera")
        return session(port, PortBench(port), camera)


def on_terminal(seed: int, speed: int) -> str:
    endpoint = free_endpoint()
    with (
        emulator(
            *("--arena", ARENA, "--seed", str(seed), "--speed", str(speed), "--baud", "9600"),
            *("--listen", endpoint),
        ) as running,
        open_session([], [endpoint]) as peer,
        serial.Serial(running.path, 9600, timeout=PATIENCE) as port,
    ):
        camera = open_camera("zenoh", port=port, session=peer, robot="khepera")
        return session(port, ZenohBench(peer, "khepera"), camera)


@pytest.fixture(scope="module")
def expected() -> str:
    return in_process(1)


def test_another_process_gives_the_same(request: pytest.FixtureRequest, expected: str) -> None:
    command = [sys.executable, "-c", IN_PROCESS, str(request.path.parent), "1"]
    said = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    assert said.split()[-1] == expected


@pytest.mark.parametrize("speed", [10, 25])
def test_a_terminal_at_any_speed_gives_the_same(speed: int, expected: str) -> None:
    assert on_terminal(1, speed) == expected


def test_another_seed_gives_another_robot(expected: str) -> None:
    assert in_process(2) != expected
