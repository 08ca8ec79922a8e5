"""Resets: they leave nothing of the robot's past."""

from collections.abc import Iterator, Sequence
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from in_process import open_robot
from khepera_protocol.zenoh.payloads import Reset

import khepera_emulator  # noqa: F401 - registers khepera://
from khepera_emulator.ports.protocol_khepera import Serial

URL = "khepera://open-box?seed=7&turret=gripper&turret=k213&turret=radio&turret=general-io"
VERSION = b"b,5.01,5.00\r\n"
BATTERY = (
    b"B|E|H|K|I,0|I,3|R,32|R,5|T,1,H,0|T,1,H,1|T,1,G|T,1,F|T,2,N|T,4,F|T,4,R|N|O|S9030000FC|serial"
    b"|C,40,-40"
).split(b"|")
REQUESTS = (
    b"A,1,2,3|F,4,5,6|J,5,6,7,8|C,90,-50|D,9,7|D,-5,3|P,60,60|G,11,-12|L,0,1|L,1,2|W,15,32|W,1,5"
    b"|N|O|H|K|T,1,D,1|T,1,E,255|T,2,U,7|T,2,N|T,4,S,1,2,3,4,0,0,0,0,0,0,0,0,0,0,0,0,0,0"
    b"|run sloader|S00600004844521B|S9030000FC|serial 19200|serial 38400|restart|M|help"
).split(b"|")
steps = st.one_of(
    st.sampled_from(REQUESTS).map(lambda line: line + b"\n"),
    st.sampled_from([b"D,9,", b"run slo", b"\0", b"x" * 300, b"\n", b"N\nO\nD,9,9\n" * 200]),
    st.sampled_from([0.0, 0.003, 0.02, 0.7]),
)


def opened(baud: str) -> Serial:
    return open_robot(f"{URL}&baud={baud}", timeout=0.3, stopbits=2)


def answers(port: Serial) -> list[bytes]:
    """Return the robot's replies to everything that can be asked."""
    said = []
    for request in BATTERY:
        port.write(request + b"\n")
        said.append(port.read_until(b"\n"))
    port.timeout = 1.0
    said.append(port.read(1))
    port.timeout = 0.3
    port.write(b"H\nK\nN\n")
    said.append(port.read(1000))
    return said


def live(port: Serial, past: Sequence[bytes | float]) -> None:
    for step in past:
        if isinstance(step, bytes):
            port.write(step)
        else:
            port.timeout = step
            port.read(100_000)
    port.timeout = 0.3


def state(port: Serial) -> tuple[Any, ...]:
    """Return what power-on sets, where the protocol does not show it."""
    robot = port.emulator.robot
    return robot.wheels, robot.panel, port.emulator.uart.baud, port.emulator.truth().speed


@pytest.mark.parametrize("baud", ["9600", "unpaced"])
def test_a_seeded_reset_has_no_past_whatever_it_was(baud: str) -> None:
    with opened(baud) as fresh:
        fresh.emulator.reset(Reset(seed=3))
        expected = state(fresh), answers(fresh)

    @settings(max_examples=20)
    @given(st.lists(steps, max_size=8))
    def check(past: Sequence[bytes | float]) -> None:
        with opened(baud) as port:
            live(port, past)
            port.emulator.reset(Reset(seed=3))
            assert (state(port), answers(port)) == expected

    check()


@pytest.mark.parametrize("baud", ["9600", "unpaced"])
def test_a_reset_without_a_seed_powers_on_as_well(baud: str) -> None:
    with opened(baud) as fresh:
        fresh.emulator.reset(Reset())
        expected = state(fresh)

    @settings(max_examples=60)
    @given(st.lists(steps, max_size=8))
    def check(past: Sequence[bytes | float]) -> None:
        with opened(baud) as port:
            live(port, past)
            port.emulator.reset(Reset())
            assert state(port) == expected
            assert port.read(1000) == b""
            port.write(b"B\nS9030000FC\nH\n")
            assert port.read(1000) == VERSION + b"Command not found\r\nh,0,0\r\n"

    check()


@pytest.mark.parametrize("seed", [None, 3])
def test_the_loader_does_not_outlive_a_reset(seed: int | None) -> None:
    with opened("unpaced") as port:
        port.write(b"run sloader\nS00600004844521B\n")
        port.read(1000)
        port.emulator.reset(Reset(seed=seed))
        port.write(b"S00600004844521B\n")
        assert port.readline() == b"Command not found\r\n"


class TestRate:
    """A rate that the tool `serial` sets holds until power-on."""

    @pytest.fixture
    def port(self) -> Iterator[Serial]:
        with opened("9600") as port:
            port.write(b"serial 38400\n")
            assert b"38400" in port.read(1000)
            port.write(b"B\n")
            assert port.read(1000) != VERSION  # this end is at 9600
            port.baudrate = 38400
            port.write(b"\nB\n")
            assert port.read(1000).endswith(VERSION)
            yield port

    @pytest.mark.parametrize("seed", [None, 3])
    def test_does_not_outlive_a_reset(self, port: Serial, seed: int | None) -> None:
        port.emulator.reset(Reset(seed=seed))
        port.baudrate = 9600
        port.write(b"B\n")
        assert port.read(1000) == VERSION

    def test_does_not_outlive_restart_whose_banner_comes_at_the_jumpers_rate(
        self, port: Serial
    ) -> None:
        port.write(b"restart\n")
        port.baudrate = 9600
        assert b"ROM of minirobot KHEPERA" in port.read(1000)
        port.write(b"B\n")
        assert port.read(1000) == VERSION

    def test_of_a_line_that_takes_no_time_is_none(self) -> None:
        with opened("unpaced") as port:
            port.write(b"serial 38400\n")
            assert b"38400" in port.readline()
            assert port.emulator.uart.baud is None

    def test_follows_the_client_where_it_leads(self) -> None:
        with opened("auto") as port:
            port.write(b"serial 38400\n")
            assert b"38400" in port.read(1000)
            assert port.emulator.uart.baud == 38400
            port.emulator.reset(Reset())
            assert port.emulator.uart.baud == 9600
            port.baudrate = 19200
            port.emulator.reset(Reset())
            assert port.emulator.uart.baud == 19200
