"""The behaviour of every robot on every port, to the byte, whatever its clients are used to."""

import os
import re
import termios
import time

import pytest
from robot_under_test import Client, Place

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

VERSIONS = {"khepera": b"b,5.01,5.00\r\n", "khepera2": b"b,5.02,5.01\r\n"}
ANY_VERSION = re.compile(rb"b,\d\.\d\d,\d\.\d\d\r\n")
NOT_FOUND = b"Command not found\r\n"
PROTOCOL_ERROR = b"z,Protocol error\r\n"
ENDS = pytest.mark.parametrize("end", [b"\n", b"\r", b"\r\n"], ids=["LF", "CR", "CRLF"])


def terminal(place: Place) -> None:
    """Skip where there is no terminal."""
    if not place.url.startswith("/dev/"):
        pytest.skip("no terminal")


class TestLineEnds:
    @ENDS
    def test_each_makes_one_request(self, client: Client, end: bytes) -> None:
        client.write(b"G,1,2" + end + b"H" + end + b"D,0,0" + end)
        assert [client.line() for _ in range(3)] == [b"g\r\n", b"h,1,2\r\n", b"d\r\n"]

    def test_of_two_bytes_may_come_apart(self, client: Client) -> None:
        assert client.ask(b"G,3,4\r") == b"g\r\n"
        assert client.ask(b"\nH\r") == b"h,3,4\r\n"

    @ENDS
    def test_alone_are_no_request(self, client: Client, end: bytes) -> None:
        assert client.ask(end * 5 + b"D,0,0\n") == b"d\r\n"

    def test_may_be_mixed(self, client: Client) -> None:
        client.write(b"\r\nG,5,6\r\r\nH\n\r\nD,0,0\r\n")
        assert [client.line() for _ in range(3)] == [b"g\r\n", b"h,5,6\r\n", b"d\r\n"]

    def test_after_a_blank_end_a_request(self, client: Client) -> None:
        assert client.ask(b" \n") == NOT_FOUND


class TestFraming:
    def test_one_byte_at_a_time(self, client: Client) -> None:
        for byte in b"G,12,-3\nH\n":
            client.write(bytes([byte]))
            client.port.flush()
        assert client.line() == b"g\r\n"
        assert client.line() == b"h,12,-3\r\n"

    @pytest.mark.parametrize("cut", range(1, 8))
    def test_requests_in_two_writes(self, client: Client, cut: int) -> None:
        request = b"G,7,-8\nH\n"
        client.write(request[:cut])
        client.write(request[cut:])
        assert client.line() + client.line() == b"g\r\nh,7,-8\r\n"

    def test_requests_back_to_back_are_answered_in_order(self, client: Client) -> None:
        client.write(b"".join(b"G,%d,0\nH\n" % number for number in range(8)))
        for number in range(8):
            assert client.line() == b"g\r\n"
            assert client.line() == b"h,%d,0\r\n" % number

    def test_replies_may_be_read_in_any_portions(self, client: Client) -> None:
        client.write(b"G,7,8\nH\nH\n")
        expected = b"g\r\nh,7,8\r\nh,7,8\r\n"
        assert b"".join(client.read(1) for _ in range(5)) == expected[:5]
        assert client.read(len(expected) - 5) == expected[5:]

    def test_nothing_is_said_unasked(self, client: Client) -> None:
        assert client.silence() == b""

    def test_half_a_request_is_not_answered(self, client: Client) -> None:
        client.write(b"G,9")
        assert client.silence() == b""
        assert client.ask(b",9\n") == b"g\r\n"

    def test_a_line_without_end_is_one_error(self, place: Place, client: Client) -> None:
        if not place.model:
            pytest.skip("a choice of the emulator")
        assert client.ask(b"x" * 1000 + b"\n") == NOT_FOUND
        assert client.ask(b"D,0,0\n") == b"d\r\n"

    def test_every_byte_is_taken(self, place: Place, client: Client) -> None:
        if not place.model:
            pytest.skip("a choice of the emulator")
        noise = bytes(byte for byte in range(256) if byte not in b"\r\n")
        assert client.ask(noise[:100] + b"\n") == NOT_FOUND
        assert client.ask(noise[100:200] + b"\n") == NOT_FOUND
        assert client.ask(noise[200:] + b"\n") == NOT_FOUND
        assert client.ask(b"D,0,0\n") == b"d\r\n"


class TestReplies:
    @pytest.mark.parametrize(
        ("request_line", "reply"),
        [
            (b"A,3800,800,100", b"a\r\n"),
            (b"D,0,0", b"d\r\n"),
            (b"F,3000,20,4000", b"f\r\n"),
            (b"G,-2147483648,2147483647", b"g\r\n"),
            (b"J,20,64,20,64", b"j\r\n"),
            (b"L,0,0", b"l\r\n"),
            (b"P,0,0", b"p\r\n"),
            (b"D,5", PROTOCOL_ERROR),
            (b"D,a,b", PROTOCOL_ERROR),
            (b"D,0,0,0", PROTOCOL_ERROR),
            (b"M", NOT_FOUND),
            (b"n", NOT_FOUND),
            (b"hello", NOT_FOUND),
            (b"1", NOT_FOUND),
        ],
    )
    def test_are_these_bytes(self, client: Client, request_line: bytes, reply: bytes) -> None:
        assert client.ask(request_line + b"\n") == reply

    def test_keep_counters_of_32_bits(self, client: Client) -> None:
        assert client.ask(b"G,-2147483648,2147483647\n") == b"g\r\n"
        assert client.ask(b"H\n") == b"h,-2147483648,2147483647\r\n"

    @pytest.mark.parametrize(
        ("request_line", "count"),
        [(b"E", 2), (b"H", 2), (b"I,3", 1), (b"K", 6), (b"N", 8), (b"O", 8)],
    )
    def test_have_so_many_plain_numbers(
        self, client: Client, request_line: bytes, count: int
    ) -> None:
        number = rb",(0|-?[1-9]\d*)"
        reply = client.ask(request_line + b"\n")
        assert re.fullmatch(request_line[:1].lower() + number * count + rb"\r\n", reply)

    @pytest.mark.parametrize("request_line", [b"N", b"O"])
    def test_of_sensors_have_ten_bits(self, client: Client, request_line: bytes) -> None:
        values = [int(word) for word in client.ask(request_line + b"\n").split(b",")[1:]]
        assert 0 <= min(values) <= max(values) <= 1023

    def test_name_the_versions(self, place: Place, client: Client) -> None:
        reply = client.ask(b"B\n")
        assert ANY_VERSION.fullmatch(reply)
        assert reply == VERSIONS.get(place.model, reply)

    def test_of_absent_turrets_are_another_line(self, client: Client) -> None:
        for number in (1, 2):
            reply = client.ask(b"T,%d,B\n" % number)
            assert reply.startswith((b"z,", b"t,%d,b," % number))
            assert reply.endswith(b"\r\n")

    @pytest.mark.parametrize("tool", [b"memory", b"process", b"k-team", b"list"])
    def test_of_tools_are_whole_lines(self, client: Client, tool: bytes) -> None:
        client.write(tool + b"\nG,0,0\n")
        lines = []
        while (line := client.line()) != b"g\r\n":
            assert line.endswith(b"\r\n")
            lines.append(line)
        assert lines
        assert NOT_FOUND not in lines

    def test_of_a_restart_are_the_banner(self, client: Client) -> None:
        client.ask(b"G,7,7\n")
        banner = client.ask(b"restart\n") + client.line()
        assert banner.startswith(b"ROM of minirobot KHEPERA")
        assert banner.endswith(b"\r\nSerial Communication Protocol\r\n")
        assert client.ask(b"H\n") == b"h,0,0\r\n"


class TestHabits:
    def test_input_is_flushed_before_every_request(self, client: Client) -> None:
        for number in range(5):
            client.port.reset_input_buffer()
            assert client.ask(b"G,%d,0\n" % number) == b"g\r\n"

    def test_both_buffers_are_flushed_and_a_break_is_sent(self, client: Client) -> None:
        client.port.reset_output_buffer()
        client.port.reset_input_buffer()
        client.port.send_break(0)
        client.port.flush()
        assert client.ask(b"D,0,0\n") == b"d\r\n"

    def test_modem_lines_are_set(self, place: Place, client: Client) -> None:
        if place.url.startswith("/dev/pts/"):
            pytest.skip("a pseudo-terminal has none")
        client.port.dtr = client.port.rts = False
        client.port.dtr = client.port.rts = True
        assert client.ask(b"D,0,0\n") == b"d\r\n"

    def test_waiting_bytes_are_polled(self, client: Client) -> None:
        client.write(b"D,0,0\n")
        deadline = time.monotonic() + 10.0
        seen = b""
        while not seen.endswith(b"\r\n"):
            assert time.monotonic() < deadline
            if waiting := client.port.in_waiting:
                seen += client.read(waiting)
        assert seen == b"d\r\n"

    def test_a_reply_ends_with_a_silence(self, client: Client) -> None:
        client.write(b"D,0,0\n")
        first = client.read(1)
        assert first + client.silence() == b"d\r\n"

    def test_a_bare_line_end_comes_first(self, client: Client) -> None:
        client.write(b"\r\n")
        assert client.silence(0.02) == b""
        assert client.ask(b"D,0,0\r\n") == b"d\r\n"

    def test_a_terminal_in_canonical_mode_gives_lines(self, place: Place) -> None:
        terminal(place)
        place.client()
        place.close()
        line = os.open(place.url, os.O_RDWR | os.O_NOCTTY)
        try:
            before = termios.tcgetattr(line)
            settings = termios.tcgetattr(line)
            settings[3] |= termios.ICANON
            termios.tcsetattr(line, termios.TCSANOW, settings)
            os.write(line, b"G,7,8\nH\n")
            assert os.read(line, 1000) == b"g\r\n"
            assert os.read(line, 1000) == b"h,7,8\r\n"
            termios.tcsetattr(line, termios.TCSANOW, before)
        finally:
            os.close(line)

    def test_drains_and_flushes_of_a_terminal_do_no_harm(
        self, place: Place, client: Client
    ) -> None:
        terminal(place)
        line = client.port.fileno()
        termios.tcdrain(line)
        termios.tcflush(line, termios.TCIOFLUSH)
        termios.tcsendbreak(line, 0)
        assert client.ask(b"D,0,0\n") == b"d\r\n"


class TestReopening:
    def test_finds_no_reply_to_the_one_before(self, place: Place) -> None:
        if not place.model:
            pytest.skip("a robot goes on speaking when its client has left")
        for _ in range(5):
            client = place.client()
            client.write(b"N\n" * 4)
            assert client.read(1) == b"n"
            again = place.open()
            assert ANY_VERSION.fullmatch(again.ask(b"B\n"))

    def test_often_does_no_harm(self, place: Place) -> None:
        place.client()
        for _ in range(10):
            assert ANY_VERSION.fullmatch(place.open().ask(b"B\n"))

    def test_finds_the_robot_as_it_was_left(self, place: Place, client: Client) -> None:
        if not place.keeps:
            pytest.skip("a robot that lives with its client")
        assert client.ask(b"G,11,12\n") == b"g\r\n"
        assert place.open().ask(b"H\n") == b"h,11,12\r\n"

    def test_after_a_hang_up_in_mid_request(self, place: Place, client: Client) -> None:
        client.write(b"G,13,1")
        client.port.flush()
        again = place.open()
        if place.keeps:
            # the robot has half a line: an empty one ends it, as clients of real robots know
            assert again.ask(b"\n") == b"g\r\n"
        assert again.ask(b"G,1,2\n") == b"g\r\n"
        assert again.ask(b"H\n") == b"h,1,2\r\n"

    def test_after_one_that_never_read(self, place: Place, client: Client) -> None:
        for _ in range(50):
            client.write(b"N\n" * 4)
        place.open()
        # a robot may be speaking while its clients change, and what it says then is heard: a client
        # that waits for what it has asked for gets it
        again = place.client()
        assert ANY_VERSION.fullmatch(again.ask(b"B\n"))
        assert again.silence() == b""

    def test_says_nothing_by_itself(self, place: Place) -> None:
        assert place.open().silence() == b""
