"""The Khepera client on ports that misbehave: every failure is one clear RobotError."""

import fcntl
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import serial
from as_type import not_none
from khepera_protocol.serial.messages import build_request
from khepera_protocol.system.terminal_link import LOCK_TEXT, lock_beside

from macor_hil.errors import LinkError, RobotError, RobotResetError, SilenceError
from macor_hil.hardware.khepera import Khepera
from macor_hil.hardware.line.serial_line import (
    LONGEST_REPLY,
    PATIENCE,
    Line,
    longest_reply,
    open_port,
    time_limit,
)

STOPPED = b"d\r\n"
RESTING = b"e,0,0\r\n"
BANNER = (
    b"ROM of minirobot KHEPERA, Edoardo Franzi K-Team S.A. October 22, 1998 Rev. 5.01\r\n"
    b"Serial Communication Protocol\r\n"
)
CLEARING = b"?\r\n"
PROXIMITY = b"n,1,2,3,4,5,6,7,8\r\n"


Reply = bytes | list[bytes] | list[bytes | Exception] | Exception


class ScriptedPort:
    """Answers request lines from a table; what has been written is in `written`.

    A reply may be an exception, which the next read raises, or a list: one reply after the other.
    A read that finds no line end gives what there is once its time-out has passed.
    """

    def __init__(self, replies: Mapping[bytes, Reply] | None = None, pending: bytes = b"") -> None:
        self.replies: dict[bytes, Reply] = {b"D,0,0": STOPPED, b"E": RESTING, **(replies or {})}
        self.pending = pending
        self.written = b""
        self.requests: list[bytes] = []
        self.now = 0.0
        self.baudrate = 9600
        self.timeout: float | None = None
        self.closed = False
        self.write_error: Exception | None = None
        self.read_error: Exception | None = None
        self._line = b""

    def write(self, data: bytes) -> int:
        if self.write_error:
            raise self.write_error
        self.written += data
        *lines, self._line = (self._line + data).replace(b"\r", b"").split(b"\n")
        for line in filter(None, lines):
            self.requests.append(line)
            reply = self.replies.get(line, b"")
            if isinstance(reply, list):
                reply = reply.pop(0) if reply else b""
            if isinstance(reply, Exception):
                self.read_error = reply
            else:
                self.pending += reply
        return len(data)

    def read_until(self, expected: bytes = b"\n", size: int | None = None) -> bytes:
        if self.read_error:
            raise self.read_error
        end = self.pending.find(expected) + len(expected)
        count = end if end >= len(expected) else len(self.pending)
        if end < len(expected):
            self.now += not_none(self.timeout)
        count = count if size is None else min(count, size)
        data, self.pending = self.pending[:count], self.pending[count:]
        return data

    def read(self, size: int = 1) -> bytes:
        self.now += not_none(self.timeout)
        data, self.pending = self.pending[:size], self.pending[size:]
        return data

    def close(self) -> None:
        self.closed = True


class BabblingPort(ScriptedPort):
    """Never stops sending; each read takes a tenth of a second of its own clock."""

    def read_until(self, _: bytes = b"\n", size: int | None = None) -> bytes:
        self.now += 0.1
        return b"\xfe" * (size or 1)


class LatePort(ScriptedPort):
    """Says nothing before its time has come."""

    def __init__(self, ready: float, replies: Mapping[bytes, Reply] | None = None) -> None:
        super().__init__(replies)
        self.ready = ready

    def read_until(self, expected: bytes = b"\n", size: int | None = None) -> bytes:
        if self.now < self.ready:
            self.now += not_none(self.timeout)
            return b""
        return super().read_until(expected, size)


FAILURES = {
    "silence": (b"", ["nothing", "0.30 s", "robot on", "9600 baud"]),
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
def test_a_bad_reply_is_a_robot_error_that_says_what_was_sent_and_came(
    reply: bytes, words: list[str]
) -> None:
    robot = Khepera(ScriptedPort({b"N": reply}))
    with pytest.raises(RobotError) as failure:
        robot.proximity()
    said = str(failure.value)
    assert r"b'N\n'" in said
    for word in words:
        assert word in said
    assert "\n" not in said


@pytest.mark.parametrize("late", [0.1, 0.2])
def test_late_replies_to_what_clears_the_line_are_not_taken_for_others(late: float) -> None:
    port = LatePort(late, {b"?": b"Command not found\r\n", b"N": PROXIMITY})
    assert Khepera(port).proximity() == (1, 2, 3, 4, 5, 6, 7, 8)
    port.ready = port.now + late
    Line(port).clear(b"D,0,0\n")
    assert port.pending == b""


def test_a_port_that_fails_in_writing_is_a_robot_error() -> None:
    port = ScriptedPort()
    port.write_error = serial.SerialException("write failed: no such device")
    with pytest.raises(
        RobotError, match=r"sent b'H\\n', then the serial port failed: write failed"
    ):
        Khepera(port).counters()


def test_an_endless_line_is_cut_short_in_the_error() -> None:
    robot = Khepera(ScriptedPort({b"N": b"x" * 10_000}))
    with pytest.raises(RobotError) as failure:
        robot.proximity()
    assert "x" * LONGEST_REPLY + "'" in str(failure.value)


def test_replies_become_values() -> None:
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


def test_connecting_ends_what_was_half_sent_and_drops_what_was_left() -> None:
    port = ScriptedPort({b"B": b"b,5.01,5.00\r\n"}, pending=b"n,1,2\r\nh,3")
    port._line = b"D,5"  # left half-sent by a client before
    robot = Khepera(port)
    assert robot.connect() == ("5.01", "5.00")
    assert port.requests == [b"D,5?", b"B"]


def test_connecting_to_what_never_pauses_ends_with_an_error() -> None:
    with pytest.raises(RobotError, match=r"have not stopped coming.*xfe.*a Khepera's port"):
        Khepera(BabblingPort()).connect()


def test_halt_stops_at_once_and_is_confirmed_past_replies_that_were_still_coming() -> None:
    port = ScriptedPort(pending=PROXIMITY)
    robot = Khepera(port)
    robot.halt()
    assert port.written == CLEARING + b"D,0,0\nD,0,0\nE\n"
    assert port.pending == b""


def test_halt_tries_again_when_a_late_reply_is_in_the_way() -> None:
    port = ScriptedPort({b"D,0,0": [b"", PROXIMITY, STOPPED, STOPPED]})
    robot = Khepera(port)
    robot.halt()
    assert port.written.count(b"D,0,0\n") == 4


def test_halt_says_so_when_the_wheels_go_on_turning(monkeypatch: pytest.MonkeyPatch) -> None:
    port = ScriptedPort({b"E": b"e,0,7\r\n"})
    read = port.read_until

    def slow_read(*arguments: Any) -> bytes:
        port.now += 0.01
        return read(*arguments)

    monkeypatch.setattr(port, "read_until", slow_read)
    with pytest.raises(RobotError, match=r"the wheels still turn: \(0, 7\)"):
        Khepera(port).halt()


def test_halt_waits_until_the_wheels_have_come_to_rest() -> None:
    port = ScriptedPort({b"E": [b"e,9,9\r\n", b"e,3,2\r\n", RESTING]})
    robot = Khepera(port)
    robot.halt()
    assert port.requests.count(b"E") == 3
    assert port.requests.count(b"D,0,0") == 2


def test_a_stop_does_not_wait_for_a_line_of_one_baud() -> None:
    port = ScriptedPort({b"D,0,0": b""})
    port.baudrate = 1  # a request takes more than a minute
    robot = Khepera(port)
    with pytest.raises(SilenceError):
        robot.halt()
    assert port.now < 6.0
    with pytest.raises(SilenceError):
        robot.connect()
    assert port.now < 20.0


def test_halt_says_so_when_no_stop_is_confirmed() -> None:
    with pytest.raises(RobotError, match=r"sent b'D,0,0\\n' and got nothing"):
        Khepera(ScriptedPort({b"D,0,0": b""})).halt()


def test_leaving_the_context_stops_the_robot_and_closes_the_port() -> None:
    port = ScriptedPort()
    with pytest.raises(ZeroDivisionError), Khepera(port):
        raise ZeroDivisionError
    assert port.requests[-2:] == [b"D,0,0", b"E"]
    assert port.closed


def test_a_robot_that_nobody_refers_to_any_more_is_stopped() -> None:
    port = ScriptedPort({b"D,5,5": b"d\r\n"})
    robot = Khepera(port)
    robot.set_speed(5, 5)
    del robot
    assert port.requests[-3:] == [b"D,0,0", b"D,0,0", b"E"]
    assert port.closed


def test_a_robot_is_stopped_once_and_after_a_reconnection_on_the_new_port() -> None:
    dead, alive = ScriptedPort(), ScriptedPort({b"H": b"h,1,2\r\n"})
    robot = Khepera(dead, lambda: alive)
    dead.write_error = OSError(5, "Input/output error")
    robot.recover(5.0)
    alive.requests.clear()
    for _ in range(2):
        robot.close()
    assert alive.requests == [b"?", b"D,0,0", b"D,0,0", b"E"]


def test_leaving_the_context_closes_a_dead_port_too() -> None:
    port = ScriptedPort()
    with Khepera(port):
        port.write_error = OSError(5, "Input/output error")
    assert port.closed


@pytest.mark.parametrize(
    "url",
    ["/dev/there-is-no-such-port", "socket://127.0.0.1:1", "nonsense://x", "khepera://no-arena"],
)
def test_a_port_that_cannot_be_opened_is_named(url: str) -> None:
    with pytest.raises(RobotError) as failure:
        open_port(url)
    assert url in str(failure.value)


def test_a_question_without_an_answer_is_asked_again_past_a_late_reply() -> None:
    port = ScriptedPort({b"N": [b"", PROXIMITY]})
    robot = Khepera(port)
    assert robot.proximity() == (1, 2, 3, 4, 5, 6, 7, 8)
    assert port.requests == [b"N", b"?", b"N"]


def test_a_question_is_asked_three_times_and_not_more() -> None:
    port = ScriptedPort()
    with pytest.raises(SilenceError) as failure:
        Khepera(port).counters()
    assert port.requests.count(b"H") == 3
    assert (failure.value.sent, failure.value.came) == (b"H\n", b"")


@pytest.mark.parametrize(("letter", "arguments"), [("L", (0, 2)), ("P", (9, 9)), ("G", (0, 0))])
def test_what_may_do_harm_twice_is_sent_once(letter: str, arguments: tuple[int, int]) -> None:
    port = ScriptedPort()
    robot = Khepera(port)
    with pytest.raises(SilenceError):
        robot.request(letter, *arguments)
    assert len(port.requests) == 1


def test_a_move_is_stopped_before_it_is_sent_again() -> None:
    port = ScriptedPort({b"C,5,6": [b"", b"c\r\n"]})
    robot = Khepera(port)
    robot.go_to(5, 6)
    assert port.requests == [b"C,5,6", b"?", b"D,0,0", b"C,5,6"]


@pytest.mark.parametrize(("counters", "sets"), [(b"h,7,8\r\n", 1), (b"h,0,1\r\n", 2)])
def test_counters_whose_setting_was_not_confirmed_are_read(counters: bytes, sets: int) -> None:
    port = ScriptedPort({b"G,7,8": [b"", b"g\r\n"], b"H": counters})
    Khepera(port).set_counters(7, 8)
    assert port.requests.count(b"G,7,8") == sets


def test_a_banner_in_place_of_a_reply_is_a_reset() -> None:
    port = ScriptedPort({b"N": BANNER})
    with pytest.raises(RobotResetError, match=r"sent b'N\\n' and got b'ROM of.*started again") as e:
        Khepera(port).proximity()
    assert e.value.came.startswith(b"ROM of minirobot")
    assert port.requests == [b"N"]


def test_a_robot_that_was_reset_gets_its_settings_and_counters_back() -> None:
    accepted = {b"J,20,64,10,32": b"j\r\n", b"G,500,600": b"g\r\n"}
    port = ScriptedPort({b"H": b"h,500,600\r\n", b"N": BANNER, **accepted})
    robot = Khepera(port)
    robot.set_profile((20, 64), (10, 32))
    robot.counters()
    with pytest.raises(RobotResetError):
        robot.proximity()
    port.requests.clear()
    assert robot.recover(0.0)
    assert port.requests[-2:] == [b"J,20,64,10,32", b"G,500,600"]
    assert not robot.recover(0.0)


def test_a_reset_that_nobody_heard_is_seen_by_the_counters() -> None:
    replies: dict[bytes, Reply] = {b"H": [b"h,500,600\r\n", b"h,2,-3\r\n"], b"G,500,600": b"g\r\n"}
    robot = Khepera(ScriptedPort(replies))
    robot.counters()
    assert robot.recover(0.0)


def test_a_robot_that_only_fell_silent_keeps_what_it_has() -> None:
    port = ScriptedPort({b"H": [b"h,500,600\r\n", b"h,640,700\r\n"]})
    robot = Khepera(port)
    robot.counters()
    assert not robot.recover(0.0)
    assert b"G,500,600" not in port.requests


def test_a_port_that_failed_is_opened_again_until_it_answers() -> None:
    dead, unplugged, alive = ScriptedPort(), ScriptedPort(), ScriptedPort({b"H": b"h,1,2\r\n"})
    for port in (dead, unplugged):
        port.write_error = OSError(5, "Input/output error")
    opened: Iterator[LinkError | ScriptedPort] = iter(
        [LinkError("no such device"), unplugged, alive]
    )

    def reopen() -> ScriptedPort:
        port = next(opened)
        if isinstance(port, Exception):
            raise port
        return port

    robot = Khepera(dead, reopen)
    with pytest.raises(LinkError):
        robot.counters()
    assert not robot.recover(5.0)
    assert robot.port is alive
    assert dead.closed
    assert unplugged.closed
    assert robot.counters() == (1, 2)


def test_a_silent_port_is_opened_again_however_short_the_patience() -> None:
    silent, alive = ScriptedPort({b"D,0,0": b""}), ScriptedPort({b"H": b"h,1,2\r\n"})
    robot = Khepera(silent, lambda: alive)
    for _ in range(3):
        with pytest.raises(SilenceError):
            robot.recover(0.0)
    assert not robot.recover(0.0)
    assert robot.port is alive
    assert silent.closed


@pytest.fixture
def link(tmp_path: Path) -> Iterator[Path]:
    """A link to a terminal, with a lock beside it that nobody holds."""
    master, slave = os.openpty()
    path = tmp_path / "robot"
    path.symlink_to(os.ttyname(slave))
    lock_beside(path).write_bytes(LOCK_TEXT)
    yield path
    os.close(slave)
    os.close(master)


def test_behind_the_link_of_an_emulator_that_has_gone_may_be_anybody(link: Path) -> None:
    with pytest.raises(LinkError, match=r"the emulator behind the link .*robot has gone"):
        open_port(str(link))


def test_behind_a_link_to_such_a_link_may_be_anybody(link: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").symlink_to(link.name)
    with pytest.raises(LinkError, match=r"the emulator behind the link .*mine has gone"):
        open_port(str(tmp_path / "mine"))


def test_a_file_of_somebody_else_in_the_place_of_a_lock_says_nothing(link: Path) -> None:
    lock_beside(link).write_text("my own")
    open_port(str(link)).close()


def test_a_link_in_a_circle_is_no_port(tmp_path: Path) -> None:
    (tmp_path / "circle").symlink_to("circle")
    with pytest.raises(LinkError, match="cannot open the serial port"):
        open_port(str(tmp_path / "circle"))


def test_a_link_whose_emulator_lives_is_opened(link: Path) -> None:
    with lock_beside(link).open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        open_port(str(link)).close()


def test_a_link_of_somebody_else_is_opened(link: Path) -> None:
    lock_beside(link).unlink()
    open_port(str(link)).close()


def test_a_robot_that_does_not_come_back_is_given_up_in_time() -> None:
    port = ScriptedPort({b"D,0,0": b""})
    robot = Khepera(port)
    with pytest.raises(SilenceError):
        robot.recover(2.0)
    assert 2.0 < port.now < 5.0


@pytest.mark.parametrize(
    ("letter", "characters"),
    [("D", 3), ("N", 43), ("H", 27), ("B", 13), ("K", 35), ("I", 8), ("T", LONGEST_REPLY)],
)
def test_the_longest_reply_comes_from_the_table(letter: str, characters: int) -> None:
    assert longest_reply(letter) == characters


def test_the_time_limit_grows_as_the_line_slows() -> None:
    fast, slow = (time_limit(build_request("N"), baud) for baud in (38400, 9600))
    assert slow - PATIENCE == pytest.approx(45 * 11 / 9600)
    assert slow - PATIENCE == pytest.approx(4 * (fast - PATIENCE))


def test_why_a_port_cannot_be_opened_is_said_once(tmp_path: Path) -> None:
    for number in (1, 2):
        (tmp_path / f"khepera-{number}").touch()
    with pytest.raises(LinkError) as none:
        open_port(str(tmp_path / "khepera"))
    end = ": there is no such file; there are khepera-1, khepera-2"
    assert str(none.value) == f"cannot open the serial port {tmp_path / 'khepera'}{end}"
    master, slave = os.openpty()
    try:
        name = os.ttyname(slave)
        with open_port(name), pytest.raises(LinkError, match="another program has it") as busy:
            open_port(name)
        assert "Errno" not in str(busy.value)
    finally:
        os.close(master)
        os.close(slave)
