"""The Khepera client on ports that misbehave: every failure is one clear RobotError."""

import pytest
import serial

from macor_hil.errors import RobotError
from macor_hil.robot import LONGEST_REPLY, Khepera, open_port

STOPPED = b"d\r\n"
PROXIMITY = b"n,1,2,3,4,5,6,7,8\r\n"


class ScriptedPort:
    """Answers request lines from a table; what has been written is in `written`.

    A reply may be an exception, which the next read raises. A read that finds no line end gives
    what there is, as after a time-out.
    """

    def __init__(self, replies=None, pending=b""):
        self.replies = {b"D,0,0": STOPPED, **(replies or {})}
        self.pending = pending
        self.written = b""
        self.baudrate = 9600
        self.timeout = None
        self.closed = False
        self.write_error = None
        self.read_error = None
        self._line = b""

    def write(self, data):
        if self.write_error:
            raise self.write_error
        self.written += data
        *lines, self._line = (self._line + data).replace(b"\r", b"").split(b"\n")
        for line in filter(None, lines):
            reply = self.replies.get(line, b"")
            if isinstance(reply, Exception):
                self.read_error = reply
            else:
                self.pending += reply
        return len(data)

    def read_until(self, expected=b"\n", size=None):
        if self.read_error:
            raise self.read_error
        end = self.pending.find(expected) + len(expected)
        count = end if end >= len(expected) else len(self.pending)
        count = count if size is None else min(count, size)
        data, self.pending = self.pending[:count], self.pending[count:]
        return data

    def close(self):
        self.closed = True


class BabblingPort(ScriptedPort):
    """Never stops sending; each read takes a tenth of a second of its own clock."""

    now = 0.0

    def read_until(self, _=b"\n", size=None):
        self.now += 0.1
        return b"\xfe" * (size or 1)


FAILURES = {
    "silence": (b"", ["nothing", "0.58 s", "robot on", "9600 baud"]),
    "half a line": (b"n,1,2,3", ["only b'n,1,2,3'"]),
    "another letter": (b"h,1,2\r\n", [r"b'h,1,2'", "another reply"]),
    "refusal": (b"z,Protocol error\r\n", ["b'z,Protocol error'", "refused"]),
    "unknown word": (b"Command not found\r\n", ["b'Command not found'", "refused"]),
    "garbage": (b"\x80\xff\x13\r\n", [r"b'\x80\xff\x13'", "baud rate"]),
    "too few values": (b"n,1,2,3\r\n", ["b'n,1,2,3'", "8 value(s)"]),
    "words for numbers": (b"n,1,2,3,4,5,6,7,x\r\n", ["integers"]),
    "echo": (b"N\r\n", ["b'N'", "another reply"]),
    "cable out": (OSError(5, "Input/output error"), ["port failed", "Input/output", "cable"]),
    "pySerial's error": (serial.SerialException("device gone"), ["port failed", "device gone"]),
}


@pytest.mark.parametrize(("reply", "words"), FAILURES.values(), ids=FAILURES.keys())
def test_a_bad_reply_is_a_robot_error_that_says_what_was_sent_and_came(reply, words):
    robot = Khepera(ScriptedPort({b"N": reply}))
    with pytest.raises(RobotError) as failure:
        robot.proximity()
    said = str(failure.value)
    assert r"b'N\n'" in said
    for word in words:
        assert word in said
    assert "\n" not in said


def test_a_port_that_fails_in_writing_is_a_robot_error():
    port = ScriptedPort()
    port.write_error = serial.SerialException("write failed: no such device")
    with pytest.raises(
        RobotError, match=r"sent b'H\\n', then the serial port failed: write failed"
    ):
        Khepera(port).counters()


def test_an_endless_line_is_cut_short_in_the_error():
    robot = Khepera(ScriptedPort({b"N": b"x" * 10_000}))
    with pytest.raises(RobotError) as failure:
        robot.proximity()
    assert "x" * LONGEST_REPLY + "'" in str(failure.value)


def test_replies_become_values():
    robot = Khepera(
        ScriptedPort(
            {
                b"N": PROXIMITY,
                b"H": b"h,-12,34\r\n",
                b"K": b"k,1,0,-3,0,1,7\r\n",
                b"C,-5,6": b"c\r\n",
                b"J,20,64,10,32": b"j\r\n",
            }
        )
    )
    assert robot.proximity() == (1, 2, 3, 4, 5, 6, 7, 8)
    assert robot.counters() == (-12, 34)
    left, right = robot.status()
    assert (left.reached, left.speed_mode, left.error) == (True, False, -3)
    assert (right.reached, right.speed_mode, right.error) == (False, True, 7)
    robot.go_to(-5, 6)
    robot.set_profile((20, 64), (10, 32))


def test_connecting_ends_what_was_half_sent_and_drops_what_was_left():
    port = ScriptedPort({b"B": b"b,5.01,5.00\r\n"}, pending=b"n,1,2\r\nh,3")
    port._line = b"D,5"  # left half-sent by a client before
    assert Khepera(port).connect() == ("5.01", "5.00")
    assert port.written == b"\r\nB\n"


def test_connecting_to_what_never_pauses_ends_with_an_error():
    with pytest.raises(RobotError, match=r"have not stopped coming.*xfe.*a Khepera's port"):
        Khepera(BabblingPort()).connect()


def test_halt_stops_at_once_and_is_confirmed_past_replies_that_were_still_coming():
    port = ScriptedPort(pending=PROXIMITY)
    Khepera(port).halt()
    assert port.written == b"\r\nD,0,0\nD,0,0\n"
    assert port.pending == b""


def test_halt_tries_again_when_a_late_reply_is_in_the_way():
    port = ScriptedPort()
    replies = iter([b"", PROXIMITY, STOPPED, STOPPED])
    port.replies = {b"D,0,0": b""}
    write = port.write

    def late(data):
        port.replies[b"D,0,0"] = next(replies)
        return write(data)

    port.write = late
    Khepera(port).halt()
    assert port.written.count(b"D,0,0\n") == 4


def test_halt_says_so_when_no_stop_is_confirmed():
    with pytest.raises(RobotError, match=r"sent b'D,0,0\\n' and got nothing"):
        Khepera(ScriptedPort({b"D,0,0": b""})).halt()


def test_leaving_the_context_stops_the_robot_and_closes_the_port():
    port = ScriptedPort()
    with pytest.raises(ZeroDivisionError), Khepera(port):
        raise ZeroDivisionError
    assert port.written.endswith(b"D,0,0\n")
    assert port.closed


def test_leaving_the_context_closes_a_dead_port_too():
    port = ScriptedPort()
    with Khepera(port):
        port.write_error = OSError(5, "Input/output error")
    assert port.closed


@pytest.mark.parametrize(
    "url",
    ["/dev/there-is-no-such-port", "socket://127.0.0.1:1", "nonsense://x", "khepera://no-arena"],
)
def test_a_port_that_cannot_be_opened_is_named(url):
    with pytest.raises(RobotError) as failure:
        open_port(url)
    assert url in str(failure.value)
