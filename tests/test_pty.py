"""The pseudo-terminal as a client's bytes, openings and closings reach it, and its link."""

import fcntl
import os
import select
import struct
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import serial
from as_type import not_none
from khepera_protocol.system.terminal_link import LOCK_TEXT, lock_beside
from unprivileged import as_nobody, enter_from_outside

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.coding import LineFormat
from khepera_emulator.ports.inotify import CLOSED_WRITABLE
from khepera_emulator.ports.link import Link
from khepera_emulator.ports.pty import PtyPort
from khepera_emulator.ports.terminal import Terminal

MUCH = 4096


@pytest.fixture
def port() -> Iterator[PtyPort]:
    port = PtyPort()
    yield port
    port.close()


@contextmanager
def client(port: PtyPort, flags: int = os.O_RDWR) -> Iterator[int]:
    terminal = os.open(port.url, flags | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        yield terminal
    finally:
        os.close(terminal)


def unread(terminal: int) -> bytes:
    data = b""
    with suppress(BlockingIOError):
        while more := os.read(terminal, 1 << 16):
            data += more
    return data


def received(port: PtyPort, limit: int = MUCH) -> list[bytes]:
    """All that clients have done by now."""
    chunks = []
    while more := port.receive(limit):
        chunks += more
    return chunks


class TestBytes:
    def test_pass_unchanged_in_both_directions(self, port: PtyPort) -> None:
        every_byte = bytes(range(256))
        with client(port) as terminal:
            os.write(terminal, every_byte)
            assert port.receive(MUCH) == [every_byte]
            port.write(every_byte)
            assert unread(terminal) == every_byte

    def test_beyond_the_limit_stay_with_the_client(self, port: PtyPort) -> None:
        with client(port) as terminal:
            os.write(terminal, b"abcdef")
            assert port.receive(0) == []
            assert port.receive(4) == [b"abcd"]
            assert port.receive(4) == [b"ef"]

    def test_that_nobody_reads_are_dropped_and_counted(self, port: PtyPort) -> None:
        with client(port) as terminal:
            assert port.receive(MUCH) == []
            for _ in range(1000):
                port.write(b"x" * 100)
            assert port.dropped > 50_000
            kept = len(unread(terminal))
            assert kept + port.dropped == 100_000
            # whoever comes next flushes its input, and that reaches no further
            assert kept <= 4095
            port.write(b"fresh")
            assert unread(terminal) == b"fresh"

    def test_that_nobody_listens_to_are_lost(self, port: PtyPort) -> None:
        for before in (b"", b"N\n"):
            with client(port) as terminal:
                os.write(terminal, before)
            received(port)
            port.write(b"stale")
            with client(port) as terminal:
                assert received(port) == []
                assert unread(terminal) == b""
                port.write(b"fresh")
                assert unread(terminal) == b"fresh"
        assert port.dropped == 0

    def test_nothing_happens_without_a_client(self, port: PtyPort) -> None:
        assert port.receive(MUCH) == []
        assert port.receive(MUCH) == []


class TestClients:
    def test_leave_after_their_last_byte(self, port: PtyPort) -> None:
        with client(port) as terminal:
            os.write(terminal, b"N\n")
        assert received(port) == [b"N\n", b""]

    def test_leave_after_the_bytes_that_the_limit_keeps_back(self, port: PtyPort) -> None:
        with client(port) as terminal:
            os.write(terminal, b"abcdef")
            assert port.receive(2) == [b"ab"]
            assert port.receive(0) == []
        assert received(port, 2) == [b"cdef", b""]

    def test_that_only_look_in_do_nothing(self, port: PtyPort) -> None:
        for flags in (os.O_RDONLY, os.O_RDWR):
            with client(port, flags):
                assert received(port) == []
            assert received(port) == []

    def test_have_not_left_while_another_is_there(self, port: PtyPort) -> None:
        with client(port) as reader:
            for request in (b"N\n", b"O\n"):
                with client(port) as writer:
                    os.write(writer, request)
                assert received(port) == [request]
                port.write(b"reply\r\n")
            with client(port):
                pass
            with client(port):
                assert received(port) == []
            assert unread(reader) == b"reply\r\nreply\r\n"
        assert received(port) == [b""]

    @pytest.mark.parametrize("stale", [10, 100_000])
    def test_that_follow_each_other_unseen_are_told_apart(self, port: PtyPort, stale: int) -> None:
        with client(port) as first:
            os.write(first, b"N\n")
            assert received(port) == [b"N\n"]
            for _ in range(stale // 10):
                port.write(b"0123456789")
            os.write(first, b"O\nE\n")
        with client(port) as second:
            os.write(second, b"B\n")
            assert received(port) == [b"O\nE\n", b"", b"B\n"]
            assert unread(second) == b""
        assert received(port) == [b""]

    def test_that_write_nothing_hide_none_who_wrote_before(self, port: PtyPort) -> None:
        with client(port) as first:
            os.write(first, b"N\n")
        with client(port):
            pass
        with client(port) as third:
            os.write(third, b"B\n")
            assert received(port) == [b"N\n", b"", b"B\n"]

    def test_that_read_already_are_not_left_with_half_a_line(self, port: PtyPort) -> None:
        with client(port) as first:
            os.write(first, b"N\n")
            assert received(port) == [b"N\n"]
            port.write(b"n,1\r\nn,2\r\n")
        with client(port) as second:
            os.write(second, b"B\n")
            assert os.read(second, 2) == b"n,"
            assert received(port) == [b"", b"B\n"]
            port.write(b"b\r\n")
            assert unread(second) == b"1\r\nn,2\r\nb\r\n"

    @pytest.mark.parametrize("late", [b"", b"O\n"])
    def test_that_write_while_somebody_looks_have_written_it(
        self, port: PtyPort, monkeypatch: pytest.MonkeyPatch, late: bytes
    ) -> None:
        with client(port) as first:
            os.write(first, b"N\n")
            assert received(port) == [b"N\n"]
            take = port._terminal.events

            def take_late() -> tuple[int, ...]:
                monkeypatch.setattr(port._terminal, "events", take)
                os.write(first, late)
                return take()

            monkeypatch.setattr(port._terminal, "events", take_late)
            os.write(first, b"E\n")
            assert port.receive(MUCH) == [b"E\n" + late]
        with client(port) as second:
            os.write(second, b"B\nK\n")
            assert received(port) == [b"", b"B\nK\n"]

    def test_that_come_or_leave_are_known_before_anybody_writes_to_them(
        self, port: PtyPort
    ) -> None:
        with client(port) as first:
            os.write(first, b"N\n")
            assert received(port) == [b"N\n"]
            assert not port.changed()
            os.write(first, b"O\n")
            assert not port.changed()
        assert port.changed()
        with client(port) as second:
            os.write(second, b"B\n")
            assert port.changed()
            assert received(port) == [b"O\n", b"", b"B\n"]
            assert not port.changed()

    def test_that_have_not_written_yet_get_none_of_their_predecessors_bytes(
        self, port: PtyPort
    ) -> None:
        for _ in range(2):
            with client(port) as first:
                os.write(first, b"N\nO\n")
            with client(port) as second:
                assert received(port) == [b"N\nO\n", b""]
                os.write(second, b"B\n")
                assert received(port) == [b"B\n"]
            assert received(port) == [b""]

    @pytest.mark.parametrize("size", [10, 100_000])
    def test_find_no_stale_bytes(self, port: PtyPort, size: int) -> None:
        with client(port) as terminal:
            os.write(terminal, b"N\n")
            assert received(port) == [b"N\n"]
            for _ in range(size // 10):
                port.write(b"0123456789")
        assert received(port) == [b""]
        with client(port) as terminal:
            assert unread(terminal) == b""
            os.write(terminal, b"N\n")
            assert received(port) == [b"N\n"]
            port.write(b"fresh")
            assert unread(terminal) == b"fresh"

    def test_that_write_and_leave_are_logged(
        self, port: PtyPort, caplog: pytest.LogCaptureFixture
    ) -> None:
        caplog.set_level("INFO")
        for _ in range(2):
            with client(port) as terminal:
                os.write(terminal, b"N\n")
                received(port)
                os.write(terminal, b"O\n")
                received(port)
            received(port)
        with client(port):
            received(port)
        said = [record.getMessage() for record in caplog.records]
        assert said == [f"{port.url}: a client writes", f"{port.url}: it has left"] * 2

    def test_may_come_and_go_often(self, port: PtyPort) -> None:
        for turn in range(100):
            with client(port) as terminal:
                os.write(terminal, b"%d\n" % turn)
            assert received(port) == [b"%d\n" % turn, b""]


class TestClientsThatComeJustThen:
    """Do what another process can do between two steps of ours."""

    @pytest.fixture
    def first(self, port: PtyPort) -> int:
        """A client that has written and was heard, to be closed by the test."""
        terminal = os.open(port.url, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        os.write(terminal, b"N\n")
        assert received(port) == [b"N\n"]
        return terminal

    @pytest.fixture
    def second(self, port: PtyPort) -> Iterator[Callable[..., int]]:
        """Opens the terminal and writes, when it is called first."""
        with ExitStack() as stack:
            opened: list[int] = []

            def come() -> int:
                if not opened:
                    opened.append(stack.enter_context(client(port)))
                    os.write(opened[0], b"B\n")
                return opened[0]

            yield come

    @staticmethod
    def before(
        monkeypatch: pytest.MonkeyPatch, owner: Terminal, name: str, act: Callable[[], object]
    ) -> None:
        """Let something happen just before every call of a function."""
        function = getattr(owner, name)

        def disturbed(*arguments: Any) -> Any:
            act()
            return function(*arguments)

        monkeypatch.setattr(owner, name, disturbed)

    @staticmethod
    def is_answered(port: PtyPort, terminal: int) -> bool:
        port.write(b"b\r\n")
        return unread(terminal) == b"b\r\n"

    def test_when_the_last_one_is_about_to_hang_up(
        self, port: PtyPort, first: int, second: Callable[..., int], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # the event of a closing comes a little before the hang-up
        events = port._terminal.events
        early, leaving = [CLOSED_WRITABLE], [first]
        monkeypatch.setattr(
            port._terminal, "events", lambda: (*events(), *(early.pop() for _ in early[:1]))
        )

        def leave_and_come() -> None:
            if leaving:
                os.close(leaving.pop())
            second()

        self.before(monkeypatch, port._terminal, "wait_for_news", leave_and_come)
        assert port.receive(MUCH) == [b"", b"B\n"]
        assert self.is_answered(port, second())

    def test_when_one_has_come_written_and_left_at_once(
        self, port: PtyPort, second: Callable[..., int], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with client(port) as quick:
            os.write(quick, b"N\n")
        self.before(monkeypatch, port._terminal, "let_go", second)
        assert port.receive(MUCH) == [b"N\n", b"", b"B\n"]
        assert self.is_answered(port, second())

    def test_when_the_event_of_a_writing_was_ahead_of_its_bytes(
        self, port: PtyPort, first: int, second: Callable[..., int], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        read, late = port._terminal.read, [b""]
        monkeypatch.setattr(
            port._terminal, "read", lambda limit: late.pop() if late else read(limit)
        )
        os.write(first, b"O\n")
        assert port.receive(MUCH) == [b"O\n"]
        os.close(first)
        second()
        assert port.receive(MUCH) == [b"", b"B\n"]
        assert self.is_answered(port, second())

    def test_when_something_is_being_said_to_the_last_one(
        self, port: PtyPort, first: int, second: Callable[..., int], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def leave_and_come() -> None:
            os.close(first)
            second()

        self.before(monkeypatch, port._terminal, "write", leave_and_come)
        port.write(b"n\r\n")
        monkeypatch.undo()
        assert port.receive(MUCH) == [b"", b"B\n"]
        assert self.is_answered(port, second())

    def test_when_the_last_one_is_found_to_have_left(
        self, port: PtyPort, first: int, second: Callable[..., int], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        os.write(first, b"O\n")
        os.close(first)
        self.before(monkeypatch, port._terminal, "read_all", second)
        assert port.receive(1) == [b"O\n", b"", b"B\n"]
        assert self.is_answered(port, second())

    def test_when_nothing_is_left_of_the_last_one(
        self, port: PtyPort, first: int, second: Callable[..., int], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        os.close(first)
        self.before(monkeypatch, port._terminal, "hold", second)
        assert port.receive(MUCH) == [b""]
        assert port.receive(MUCH) == [b"B\n"]
        assert self.is_answered(port, second())

    @pytest.mark.parametrize("step", ["hold", "open"])
    def test_when_another_has_been_there_in_between(
        self,
        port: PtyPort,
        first: int,
        second: Callable[..., int],
        monkeypatch: pytest.MonkeyPatch,
        step: str,
    ) -> None:
        os.close(first)
        others = [b"O\n"]

        def come_one_by_one() -> None:
            if others:
                with client(port) as another:
                    os.write(another, others.pop())
                second()

        opening = os.open

        def open_late(name: str, *flags: int) -> int:
            monkeypatch.setattr(os, "open", opening)
            come_one_by_one()
            return opening(name, *flags)

        if step == "hold":
            self.before(monkeypatch, port._terminal, "hold", come_one_by_one)
        else:
            monkeypatch.setattr(os, "open", open_late)
        assert port.receive(MUCH) == [b""]
        assert port.receive(MUCH) == [b"O\n", b"", b"B\n"]
        assert self.is_answered(port, second())

    def test_when_the_terminal_is_being_opened(
        self, port: PtyPort, first: int, second: Callable[..., int], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        os.close(first)
        path = port.url
        openings = os.open

        def open_both(name: str, *flags: int) -> int:
            if name == path and len(waits) == 0:
                waits.append(None)
                second()
            return openings(name, *flags)

        waits: list[None] = []
        monkeypatch.setattr(os, "open", open_both)
        assert port.receive(MUCH) == [b""]
        assert waits
        # two openings are one event: who has come is known when it has written
        monkeypatch.setattr(port._terminal, "wait_for_news", pytest.fail)
        assert port.receive(MUCH) == [b"B\n"]
        assert self.is_answered(port, second())

    def test_again_and_again(
        self, port: PtyPort, first: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        os.write(first, b"O\n")
        os.close(first)
        left = [b"X\n", b"Y\n"]
        with client(port) as last:

            def come_and_go() -> None:
                if left:
                    with client(port) as another:
                        os.write(another, left.pop(0))

            self.before(monkeypatch, port._terminal, "read_all", come_and_go)
            chunks = received(port)
            assert b"".join(chunks) == b"O\nX\nY\n"
            os.write(last, b"B\n")
            assert received(port)[-1] == b"B\n"
            assert self.is_answered(port, last)


class TestSettings:
    def test_begin_raw_at_9600(self, port: PtyPort) -> None:
        with client(port) as terminal:
            _, output, _, local, _, rate, _ = termios.tcgetattr(terminal)
            assert rate == termios.B9600
            assert not output & termios.OPOST
            assert not local & (termios.ECHO | termios.ICANON)
        assert port.settings() == LineFormat(9600, stop=1)

    @pytest.mark.parametrize("rate", [1200, 9600, 19200, 38400, 57600, 115200])
    def test_rate_is_the_clients(self, port: PtyPort, rate: int) -> None:
        with client(port) as terminal:
            settings = termios.tcgetattr(terminal)
            settings[4] = settings[5] = getattr(termios, f"B{rate}")
            termios.tcsetattr(terminal, termios.TCSANOW, settings)
            assert not_none(port.settings()).baud == rate
        received(port)
        assert not_none(port.settings()).baud == rate  # as `stty` wants it

    def test_rate_may_be_any_number(self, port: PtyPort) -> None:
        with serial.Serial(port.url, 31250, stopbits=2):
            assert port.settings() == LineFormat(31250, stop=2)

    def test_rate_of_zero_is_none(self, port: PtyPort) -> None:
        with client(port) as terminal:
            settings = termios.tcgetattr(terminal)
            settings[4] = settings[5] = termios.B0
            termios.tcsetattr(terminal, termios.TCSANOW, settings)
            assert port.settings() is None

    @pytest.mark.parametrize("request_line", [b"", b"N\n"])
    def test_outlive_the_client_as_on_a_serial_port(
        self, port: PtyPort, request_line: bytes
    ) -> None:
        with client(port) as terminal:
            settings = termios.tcgetattr(terminal)
            settings[0] |= termios.ICRNL
            settings[3] |= termios.ICANON
            termios.tcsetattr(terminal, termios.TCSANOW, settings)
            os.write(terminal, request_line)
            received(port)
        received(port)
        with client(port) as terminal:
            assert termios.tcgetattr(terminal)[:6] == settings[:6]

    @pytest.mark.parametrize("request_line", [b"", b"N\n"])
    def test_bar_nobody_for_ever(self, request_line: bytes) -> None:
        def check() -> None:
            port = PtyPort()
            with client(port) as terminal:
                # it would stay so when the client has left: only root could open it, not we
                fcntl.ioctl(terminal, termios.TIOCEXCL)
                assert is_exclusive(terminal)
                os.write(terminal, request_line)
                received(port)
            received(port)
            with client(port) as terminal:
                assert not is_exclusive(terminal)
                os.write(terminal, b"D,0,0\n")
                assert received(port) == [b"D,0,0\n"]
                port.write(b"d\r\n")
                assert unread(terminal) == b"d\r\n"
            port.close()

        as_nobody(check)

    def test_modem_lines_flushes_and_breaks_do_no_harm(self, port: PtyPort) -> None:
        with client(port) as terminal:
            tty.setraw(terminal)
            termios.tcflush(terminal, termios.TCIOFLUSH)
            termios.tcdrain(terminal)
            termios.tcsendbreak(terminal, 0)
            os.write(terminal, b"B\n")
            assert port.receive(MUCH) == [b"B\n"]


class TestWhatAClientLeaves:
    """A terminal that is of no use to the next client is put right, or left for another one."""

    @pytest.mark.parametrize(
        ("before", "how"), [(b"", "TCOOFF"), (b"N\n", "TCOOFF"), (b"N\n", "XOFF")]
    )
    def test_stopped_output_does_not_block_the_next(
        self, port: PtyPort, before: bytes, how: str
    ) -> None:
        with client(port) as terminal:
            os.write(terminal, before)
            received(port)
            stop_output(port, terminal, how)
            with pytest.raises(BlockingIOError):
                os.write(terminal, b"x")
        received(port)
        with client(port) as terminal:
            os.write(terminal, b"B\n")
            assert received(port) == [b"B\n"]

    @pytest.mark.parametrize("how", ["TCOOFF", "XOFF"])
    @pytest.mark.parametrize("reads", [False, True])
    def test_stopped_output_does_not_block_one_that_has_come_already(
        self, port: PtyPort, how: str, reads: bool
    ) -> None:
        with client(port) as first:
            os.write(first, b"N\n")
            assert received(port) == [b"N\n"]
            stop_output(port, first, how)
            port.write(b"n\r\n")
        with client(port) as second:
            if reads:
                os.read(second, 1)
            received(port)
            os.write(second, b"B\n")
            assert received(port)[-1] == b"B\n"

    @pytest.mark.parametrize("rate", [38400, 31250])
    def test_exclusive_use_makes_the_line_move(self, tmp_path: Path, rate: int) -> None:
        link_path = tmp_path / "khepera"

        def check() -> None:
            with Link(link_path) as link:
                port = PtyPort(link.point_to)
                link.point_to(port.url)
                first = port.url
                with serial.Serial(port.url, rate) as theirs:
                    theirs.write(b"N\n")
                    assert received(port) == [b"N\n"]
                    fcntl.ioctl(theirs.fileno(), termios.TIOCEXCL)
                    with pytest.raises(OSError, match="busy"):
                        os.open(port.url, os.O_RDWR | os.O_NOCTTY)
                assert received(port) == [b""]
                assert port.url != first
                assert str(link_path.readlink()) == port.url
                assert port.settings() == LineFormat(rate)
                is_served(port)
                port.close()

        tmp_path.chmod(0o777)
        enter_from_outside(tmp_path)
        as_nobody(check)

    def test_exclusive_use_by_one_that_followed_another_makes_the_line_move(self) -> None:
        def check() -> None:
            moved: list[str] = []
            port = PtyPort(moved.append)
            with client(port) as first:
                os.write(first, b"N\n")
                assert received(port) == [b"N\n"]
            with client(port) as second:
                fcntl.ioctl(second, termios.TIOCEXCL)
                os.write(second, b"B\n")
                assert received(port) == [b"", b"B\n"]
                port.write(b"b\r\n")
                assert unread(second) == b"b\r\n"
            assert received(port) == [b""]
            assert moved == [port.url]
            is_served(port)
            port.close()

        as_nobody(check)

    def test_a_link_that_cannot_be_turned_is_no_end(self, caplog: pytest.LogCaptureFixture) -> None:
        def moved(path: str) -> None:
            raise EmulatorError(f"cannot turn the link to {path}")

        def check() -> None:
            port = PtyPort(moved)
            with client(port) as first:
                os.write(first, b"N\n")
                received(port)
                fcntl.ioctl(first, termios.TIOCEXCL)
            assert received(port) == [b""]
            assert f"cannot turn the link to {port.url}" in caplog.text
            is_served(port)
            port.close()

        as_nobody(check)


def stop_output(port: PtyPort, terminal: int, how: str) -> None:
    if how == "TCOOFF":
        termios.tcflow(terminal, termios.TCOOFF)
    else:
        settings = termios.tcgetattr(terminal)
        settings[0] |= termios.IXON
        termios.tcsetattr(terminal, termios.TCSANOW, settings)
        port.write(b"\x13")
    while select.select((), (terminal,), (), 0)[1]:
        pass  # an XOFF takes a moment to get through


def is_served(port: PtyPort) -> None:
    with client(port) as terminal:
        os.write(terminal, b"B\n")
        assert received(port) == [b"B\n"]
        port.write(b"b\r\n")
        assert unread(terminal) == b"b\r\n"
    assert received(port) == [b""]


def is_exclusive(terminal: int) -> bool:
    (exclusive,) = struct.unpack("i", fcntl.ioctl(terminal, 0x80045440, bytes(4)))
    return bool(exclusive == 1)


class TestLink:
    def test_points_to_the_terminal_and_goes_with_its_holder(self, tmp_path: Path) -> None:
        path = tmp_path / "runs" / "khepera"
        with Link(path) as link:
            link.point_to("/dev/pts/77")
            assert path.readlink() == Path("/dev/pts/77")
        assert list(path.parent.iterdir()) == []

    def test_is_turned_in_one_step(self, tmp_path: Path) -> None:
        path = tmp_path / "khepera"
        with Link(path) as link:
            link.point_to("/dev/pts/77")
            link.point_to("/dev/pts/78")
            assert path.readlink() == Path("/dev/pts/78")

    def test_of_a_dead_emulator_is_taken_over(self, tmp_path: Path) -> None:
        path = tmp_path / "khepera"
        path.symlink_to("/dev/pts/77")
        lock_beside(path).touch()
        with Link(path) as link:
            assert not path.is_symlink()  # terminal 77 may be anybody's by now
            link.point_to("/dev/pts/78")
            assert path.readlink() == Path("/dev/pts/78")

    @pytest.mark.parametrize("name", ["Cargo.lock", "Cargo.{pid}", "Cargo"])
    def test_takes_no_file_of_a_user_for_its_own(self, tmp_path: Path, name: str) -> None:
        mine = tmp_path / name.format(pid=os.getpid())
        mine.write_text("precious")
        link_path = tmp_path / ("Cargo" if mine.name != "Cargo" else "khepera")
        with Link(link_path) as link:
            link.point_to("/dev/pts/77")
            link.point_to("/dev/pts/78")
        assert [entry.name for entry in tmp_path.iterdir()] == [mine.name]
        assert mine.read_text() == "precious"

    def test_removes_no_lock_but_its_own(self, tmp_path: Path) -> None:
        path = tmp_path / "khepera"
        with Link(path):
            lock_beside(path).unlink()
            lock_beside(path).write_text("precious")
        assert lock_beside(path).read_text() == "precious"

    @pytest.mark.parametrize("kind", ["file", "link", "folder", "pipe"])
    def test_leaves_what_stands_where_its_lock_belongs(self, tmp_path: Path, kind: str) -> None:
        path = tmp_path / "khepera"
        lock, mine = lock_beside(path), tmp_path / "mine"
        mine.write_text("precious")
        if kind == "file":
            lock.write_text("precious")
        elif kind == "link":
            lock.symlink_to(mine)
        elif kind == "folder":
            lock.mkdir()
        else:
            os.mkfifo(lock)
        before = lock.lstat()
        with pytest.raises(EmulatorError, match="give another --link"):
            Link(path)
        assert os.path.samestat(lock.lstat(), before)
        assert mine.read_text() == "precious"
        assert not path.is_symlink()

    def test_that_no_emulator_has_made_is_kept(self, tmp_path: Path) -> None:
        path = tmp_path / "khepera"
        path.symlink_to("/dev/pts/77")
        with pytest.raises(EmulatorError, match="that no emulator has made; give another --link"):
            Link(path)
        assert path.readlink() == Path("/dev/pts/77")
        assert [entry.name for entry in tmp_path.iterdir()] == ["khepera"]

    def test_says_in_its_lock_what_it_is(self, tmp_path: Path) -> None:
        path = tmp_path / "khepera"
        with Link(path):
            assert lock_beside(path).read_bytes() == LOCK_TEXT

    @pytest.mark.parametrize("path", ["/", ".", "", "x" * 300, "x" * 250, "/proc/khepera"])
    def test_that_cannot_be_is_refused_in_one_sentence(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: str
    ) -> None:
        monkeypatch.chdir(tmp_path)
        with pytest.raises(EmulatorError, match=r"give a path|give another --link") as refused:
            Link(Path(path))
        assert len(str(refused.value)) < 300
        assert list(tmp_path.iterdir()) == []

    def test_is_taken_over_while_somebody_looks_who_holds_it(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = tmp_path / "khepera"
        with lock_beside(path).open("w") as looking:
            fcntl.flock(looking, fcntl.LOCK_SH)
            monkeypatch.setattr("time.sleep", lambda _: fcntl.flock(looking, fcntl.LOCK_UN))
            with Link(path) as link:
                link.point_to("/dev/pts/78")

    def test_has_one_holder_at_a_time(self, tmp_path: Path) -> None:
        path = tmp_path / "khepera"
        with Link(path) as link:
            link.point_to("/dev/pts/77")
            with pytest.raises(EmulatorError, match="held by an emulator that is running"):
                Link(path)
            assert path.readlink() == Path("/dev/pts/77")
        with Link(path):
            pass

    def test_turned_elsewhere_is_left_alone(self, tmp_path: Path) -> None:
        path = tmp_path / "khepera"
        with Link(path) as link:
            link.point_to("/dev/pts/77")
            path.unlink()
            path.symlink_to("/dev/pts/78")
        assert path.readlink() == Path("/dev/pts/78")

    @pytest.mark.parametrize("kind", ["file", "folder", "foreign link"])
    def test_never_replaces_anything_else(self, tmp_path: Path, kind: str) -> None:
        path = tmp_path / "khepera"
        if kind == "file":
            path.write_text("precious")
        elif kind == "folder":
            path.mkdir()
        else:
            path.symlink_to("/dev/ttyUSB0")
        with pytest.raises(EmulatorError, match="give another --link"):
            Link(path)
        assert [entry.name for entry in tmp_path.iterdir()] == ["khepera"]
        assert kind != "file" or path.read_text() == "precious"

    def test_below_a_file_cannot_be(self, tmp_path: Path) -> None:
        (tmp_path / "file").touch()
        with pytest.raises(EmulatorError, match="cannot make the link"):
            Link(tmp_path / "file" / "khepera")
