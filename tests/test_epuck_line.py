"""An e-puck's line: times on the wire, garbage, programs that do things in any order."""

import gc
import os
import random
from pathlib import Path

import pytest
from epuck_machine import FLUSH, EpuckMachine
from hypothesis import settings
from in_process import open_robot
from khepera_protocol.epuck import codes
from khepera_protocol.epuck.letters import LETTERS
from khepera_protocol.epuck.packets import Actuators
from khepera_protocol.epuck.wifi import WifiRequest

from khepera_emulator.app.replay import replay
from khepera_emulator.line.wire_log import WireLog, read_log

TestAnyOrder = EpuckMachine.TestCase
TestAnyOrder.settings = settings(max_examples=4, stateful_step_count=10, deadline=None)

BYTE = 10 / 115_200
PAGE = os.sysconf("SC_PAGE_SIZE")
LEAK = 6 << 20
"""Bytes by which memory may grow while garbage comes: caches fill up."""

WORDS = [
    *(letter.encode() for letter in LETTERS if letter not in "I"),
    *(b"D,100,-50", b"P,1,2", b"J,0,8,8,4", b"L,1,2", b"T,3", b"B,2", b"X,9", b"\r", b"\r\n"),
    *(bytes([byte]) for byte in codes.EPUCK2_CODES),
    codes.row(("D", codes.pack([50, -50])), "N"),
    codes.row((0xF7, Actuators(wheels=(20, 30)).pack()), 0xF8),
]


def resident() -> int:
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def garbage(size: int, seed: int) -> bytes:
    """Words of the protocol and plain chance, in turn."""
    chance = random.Random(seed)
    parts: list[bytes] = []
    length = 0
    while length < size:
        part = chance.choice(WORDS) if chance.random() < 0.7 else chance.randbytes(8)
        parts.append(part)
        length += len(part)
    return b"".join(parts)[:size]


def take(model: str, size: int, seed: int, profile: str = "") -> None:
    """Bytes to a robot; then it answers at once, and no memory has gone."""
    url = f"khepera://open-box?model={model}&profile={profile}&baud=unpaced&seed={seed}"
    with open_robot(url, timeout=1.0) as port:
        before = 0
        piece = 4096
        for at in range(0, size, piece):
            port.write(garbage(min(piece, size - at), seed + at))
            port.emulator.advance(port.now)
            port.emulator.read()
            if at == size // 5 // piece * piece:
                before = resident()
        assert resident() < before + LEAK
        if profile == "wifi":
            port.write(bytes(21) + WifiRequest(sensors=False).pack())
            port.emulator.advance(port.now)
            assert port.emulator.read().endswith(b"\3")
            return
        port.write(FLUSH)
        port.emulator.advance(port.now)
        port.emulator.read()
        port.write(b"D,0,0\rP,3,4\rQ\r")
        port.emulator.advance(port.now)
        assert port.emulator.read() == b"d\r\np\r\nq,3,4\r\n"


@pytest.mark.parametrize(
    ("model", "profile"), [("epuck", ""), ("epuck", "btcom"), ("epuck2", ""), ("epuck2", "wifi")]
)
def test_garbage_leaves_a_robot_that_answers(model: str, profile: str) -> None:
    take(model, 10_000, seed=1, profile=profile)


@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(
    ("model", "profile"), [("epuck", ""), ("epuck", "btcom"), ("epuck2", ""), ("epuck2", "wifi")]
)
def test_ten_million_bytes_of_garbage_leave_a_robot_that_answers(model: str, profile: str) -> None:
    take(model, 2_500_000, seed=2, profile=profile)


def test_actuators_and_sensors_take_the_time_of_their_bytes() -> None:
    with open_robot("khepera://open-box?model=epuck2", baudrate=115_200, timeout=1.0) as port:
        started = port.now
        port.write(codes.row((0xF7, Actuators().pack()), 0xF8))
        assert len(port.read(103)) == 103
        # 22 bytes out, 103 back, and the firmware's 50 us
        assert port.now - started == pytest.approx(125 * BYTE + 50e-6, abs=1e-6)


def test_more_than_the_ring_holds_is_lost_while_it_calibrates() -> None:
    with open_robot("khepera://open-box?model=epuck2", baudrate=115_200, timeout=5.0) as port:
        port.write(b"K\r" + b"C\r" * 50)
        port.emulator.advance(port.now + 3.0)
        said = port.emulator.read()
        assert said.count(b"c,3\r\n") == 32
        assert port.emulator.uart.lost == 36


@pytest.mark.parametrize(
    ("model", "profile"), [("epuck", "gctronic"), ("epuck", "btcom"), ("epuck2", "")]
)
def test_all_pictures_that_a_row_asks_for_come(model: str, profile: str) -> None:
    url = f"khepera://corridor?model={model}&profile={profile}"
    with open_robot(url, baudrate=115_200, timeout=3.0) as port:
        picture = codes.PICTURE_HEAD + port.emulator.robot.panel.picture.size
        port.write(codes.row(*["I"] * 5))
        assert len(port.read(6 * picture)) == 5 * picture


def test_a_pause_between_bytes_does_no_harm() -> None:
    with open_robot("khepera://open-box?model=epuck2", baudrate=115_200, timeout=1.0) as port:
        for byte in b"P,5,6\r" + codes.row("Q"):
            port.write(bytes([byte]))
            port.emulator.advance(port.now + 0.05)
        assert port.read(7) == b"p\r\n\x05\x00\x06\x00"


def test_a_log_of_rows_and_text_is_replayed(tmp_path: Path) -> None:
    url = "khepera://corridor?model=epuck2&seed=3"
    file = tmp_path / "wire.jsonl"
    with open_robot(url, baudrate=115_200, timeout=1.0) as port, WireLog(file, url) as log:
        for request in (b"D,300,300\r", codes.row("N", "Q"), b"V\r", codes.row(0xF8), b"Q\r"):
            log.request(port.now, request)
            port.write(request)
            port.emulator.advance(port.now + 0.2)
            log.reply(port.now, port.emulator.read())
    kept = read_log(file)
    with open_robot(url, baudrate=115_200, timeout=1.0) as port:
        lines = replay(kept, port)
    assert isinstance(lines, int), str(lines)
    assert lines >= 4
