"""The line: faults, scripts, addresses, URLs, options, requests, telnet and what clients leave.

Whatever comes in, it is taken, or refused in one sentence that a terminal shows as it is; and the
next client is served.
"""

import fcntl
import os
import select
import socket
import struct
import sys
import termios
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import serial
from hostile_inputs import Hostile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from in_process import open_robot
from serial import rfc2217

import khepera_emulator  # noqa: F401 - registers khepera://
from khepera_emulator.app import daemon
from khepera_emulator.app.cli.program import run
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.fault import FAULTS, Fault
from khepera_emulator.line.fault_text import parse_fault, read_script, script_specs
from khepera_emulator.ports import tcp
from khepera_emulator.ports.link import Link
from khepera_emulator.ports.pty import PtyPort
from khepera_emulator.ports.rfc2217 import Rfc2217Port
from khepera_emulator.ports.tcp import TcpPort, tcp_address

LONGEST = 2000
"""Characters of the longest sentence."""

NUMBERS = ["", "0", "-0", "-1", "nan", "inf", "-inf", "1e308", "1e-308", "1e999", "0x1", "1_0"]
NUMBERS += ["1" * 5000, "0." + "0" * 5000 + "1", "\u0661", "\u00bd", "1\n", " 1", "1e", "--1", "\0"]
PATHS = ["", "/", ".", "..", "x" * 300, "/proc/none/x", "\x1b[31m/x", "a/" * 3000, "/dev/null/x"]
numbers = st.sampled_from(NUMBERS) | st.floats().map(str) | st.integers().map(str)


def check_sentence(error: EmulatorError | serial.serialutil.SerialException) -> None:
    sentence = str(error)
    assert sentence.isprintable(), repr(sentence)
    assert len(sentence) < LONGEST


def settings_of(hostile: Hostile, number: int) -> settings:
    return settings(
        max_examples=hostile.examples(number),
        deadline=None,
        suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    )


class TestFaults:
    keys = st.sampled_from(["p", "n", "dir", "at", "for", "time", "text", "x", ""])
    values = numbers | st.text(max_size=20)
    specs = st.builds(
        lambda kind, pairs: f"{kind}:{','.join(f'{key}={value}' for key, value in pairs)}",
        st.sampled_from([*FAULTS.names(), "", "cake"]),
        st.lists(st.tuples(keys, values), max_size=5),
    )

    def test_are_bounded_or_refused(self, hostile: Hostile) -> None:
        @settings_of(hostile, 300)
        @given(self.specs | st.text(max_size=200) | st.sampled_from(["drop:" + "p=1," * 10_000]))
        def check(spec: str) -> None:
            hostile.count("faults")
            try:
                fault = parse_fault(spec)
            except EmulatorError as error:
                check_sentence(error)
                return
            assert isinstance(fault, Fault)
            assert 0.0 <= (fault.chance or 0.0) <= 1.0
            assert 0.0 <= fault.at <= 2.0**23
            assert 0.0 <= fault.time <= 2.0**23
            assert fault.lasts >= 0.0
            assert fault.most >= 0.0

        check()

    def test_scripts_are_bounded_or_refused(self, hostile: Hostile, tmp_path: Path) -> None:
        file = tmp_path / "script"
        line = st.builds("{} {}\n".format, numbers, self.specs).map(str.encode) | st.binary()

        @settings_of(hostile, 100)
        @given(st.lists(line, max_size=10).map(b"".join))
        def check(data: bytes) -> None:
            hostile.count("fault scripts")
            file.write_bytes(data)
            try:
                specs = read_script(file)
            except EmulatorError as error:
                check_sentence(error)
                return
            assert specs == script_specs(data.decode())

        check()

    @pytest.mark.parametrize(
        "data",
        [
            b"1 drop\n" * 100_000,
            b"\n" * 2_000_000,
            b"1 " + b"drop:" * 1_000_000,
            bytes(1_000_001),
            b"1 stray:text=" + b"\\x00" * 5000,
        ],
    )
    def test_huge_scripts_are_refused(self, hostile: Hostile, tmp_path: Path, data: bytes) -> None:
        hostile.count("fault scripts")
        file = tmp_path / "script"
        file.write_bytes(data)
        with pytest.raises(EmulatorError) as refused:
            read_script(file)
        check_sentence(refused.value)

    @pytest.mark.parametrize("path", [*PATHS, "/dev/zero", "/proc/self/mem"])
    def test_scripts_that_are_none_are_refused(self, hostile: Hostile, path: str) -> None:
        hostile.count("fault scripts")
        with pytest.raises(EmulatorError) as refused:
            read_script(Path(path))
        check_sentence(refused.value)


class TestAddresses:
    def test_are_taken_or_refused(self, hostile: Hostile) -> None:
        text = st.text(max_size=80) | st.builds("{}:{}".format, st.text(max_size=80), numbers)

        @settings_of(hostile, 300)
        @given(text)
        def check(address: str) -> None:
            hostile.count("addresses")
            try:
                host, port = tcp_address(address)
            except EmulatorError as error:
                check_sentence(error)
                return
            assert host
            assert 0 <= port <= 65535

        check()

    # no name that somebody would be asked for
    @pytest.mark.parametrize(
        "host", ["x" * 64, "x" * 300, ".", "..", "a..b", "\u00fc" * 70, "[", "[::"]
    )
    def test_without_a_machine_are_refused(self, hostile: Hostile, host: str) -> None:
        hostile.count("addresses")
        with pytest.raises(EmulatorError) as refused:
            TcpPort(f"{host}:1")
        check_sentence(refused.value)


class TestOptions:
    """Every option of `run` that takes a value, and the paths and numbers of a bad day."""

    NUMBERED = ["--seed", "--robots", "--speed", "--dead-man", "--camera-rate", "--baud", "--drift"]
    TEXTS = ["--model", "--turret", "--firmware", "--fault", "--tcp", "--rfc2217", "--robot"]

    @pytest.fixture
    def starts(
        self,
        monkeypatch: pytest.MonkeyPatch,
        capfd: pytest.CaptureFixture[str],
        hostile: Hostile,
        tmp_path: Path,
    ) -> Callable[..., tuple[int, str]]:
        """Run a command that would serve a robot, and give its status; it serves nobody."""
        monkeypatch.setattr(daemon.Daemon, "run", lambda _: None)
        monkeypatch.chdir(tmp_path)

        def start(*arguments: str) -> tuple[int, str]:
            hostile.count("options")
            monkeypatch.setattr(sys, "argv", ["khepera-emulator", "run", "--no-zenoh", *arguments])
            status = run()
            out, err = capfd.readouterr()
            assert status in (0, 2), err
            assert "Traceback" not in err
            assert (out + err).replace("\n", "").isprintable()
            if status:
                assert out == ""
                assert len(err) < 4 * LONGEST
            else:
                assert out.startswith("khepera")
            return status, err

        return start

    @pytest.mark.parametrize("option", NUMBERED)
    @pytest.mark.parametrize("value", [each for each in NUMBERS if "\0" not in each])
    def test_numbers_are_taken_or_refused(
        self, starts: Callable[..., tuple[int, str]], option: str, value: str
    ) -> None:
        starts(f"{option}={value}")

    @pytest.mark.parametrize("option", TEXTS)
    @pytest.mark.parametrize(
        "value", ["", "x" * 5000, "1" * 5000, "\x1b[31m", "\udcff", "a=\u2028"]
    )
    def test_texts_are_refused(
        self, starts: Callable[..., tuple[int, str]], option: str, value: str
    ) -> None:
        assert starts(f"{option}={value}")[0] == 2

    @pytest.mark.parametrize("option", ["--link", "--record", "--fault-script", "--arena"])
    @pytest.mark.parametrize("robots", ["1", "2"])
    @pytest.mark.parametrize("value", PATHS)
    def test_paths_are_refused_in_one_sentence(
        self,
        starts: Callable[..., tuple[int, str]],
        tmp_path: Path,
        option: str,
        robots: str,
        value: str,
    ) -> None:
        status, said = starts("--arena", "open-box", "--robots", robots, f"{option}={value}")
        if option == "--link" and "\x1b" in value:  # a name like others: its folder is made
            assert status == 0
            return
        assert status == 2
        assert said.count("\n") == 1
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("option", ["--link", "--record"])
    def test_what_is_there_already_is_kept(
        self, starts: Callable[..., tuple[int, str]], tmp_path: Path, option: str
    ) -> None:
        folder, below = tmp_path / "folder", tmp_path / "file" / "below"
        folder.mkdir()
        below.parent.write_text("precious")
        for path in (folder, below, tmp_path / "none" / "x" if option == "--record" else below):
            status, said = starts(f"{option}={path}")
            assert status == 2
            assert said.count("\n") == 1
        assert below.parent.read_text() == "precious"
        assert sorted(each.name for each in tmp_path.iterdir()) == ["file", "folder"]


class TestUrls:
    """`khepera://` URLs, which come from files and from programs of others."""

    NAMES = ["seed", "model", "drift", "baud", "dead-man", "robots", "robot", "fault", "turret"]

    def test_open_a_robot_or_are_refused(self, hostile: Hostile) -> None:
        value = numbers | st.text(max_size=12)
        pairs = st.lists(
            st.tuples(st.sampled_from([*self.NAMES, "firmware", "x"]), value), max_size=3
        )
        arena = st.sampled_from(
            ["open-box", "", "[", "%00", "\0", "x" * 300, "..", "%ff", "open-box#"]
        )

        @settings_of(hostile, 100)
        @given(st.sampled_from(["open-box"]) | arena, pairs)
        def check(name: str, options: list[tuple[str, str]]) -> None:
            hostile.count("khepera:// URLs")
            query = "&".join(f"{key}={value}" for key, value in options)
            try:
                port = open_robot(f"khepera://{name}?{query}", timeout=1)
            except serial.SerialException as error:
                check_sentence(error)
                return
            with port:
                port.write(b"\nH\n")
                assert port.read_until(b"\n").endswith(b"\n") or "fault" in query or "baud" in query

        check()

    @pytest.mark.parametrize("name", NAMES)
    @pytest.mark.parametrize("value", ["1" * 5000, "nan", "scale=nan", "delay:for=1e308"])
    def test_with_impossible_numbers_are_refused(
        self, hostile: Hostile, name: str, value: str
    ) -> None:
        hostile.count("khepera:// URLs")
        with pytest.raises(serial.SerialException) as refused:
            open_robot(f"khepera://open-box?{name}={value}")
        check_sentence(refused.value)

    def test_with_faults_without_number_are_refused(self, hostile: Hostile) -> None:
        hostile.count("khepera:// URLs")
        with pytest.raises(serial.SerialException, match="a line takes 1,000 at most"):
            open_robot("khepera://open-box?" + "fault=drop&" * 2000)


class TestRequests:
    def test_of_any_kind_leave_a_robot_that_answers(self, hostile: Hostile) -> None:
        pieces = st.one_of(
            st.binary(max_size=200),
            st.sampled_from(
                [b"\0", b"\n\0", b"\r", b"N", b"x" * 300, b"D,9,9\n", b"run sloader\n"]
            ),
            st.builds(
                b"%b,%b\n".__mod__,
                st.tuples(
                    st.sampled_from([b"A", b"C", b"D", b"T,1,E"]),
                    numbers.map(lambda each: each.encode("utf-8", "replace")),
                ),
            ),
        )

        with open_robot("khepera://open-box?baud=unpaced&turret=gripper", timeout=0.5) as port:

            @settings_of(hostile, 200)
            @given(st.lists(pieces, max_size=10))
            def check(parts: list[bytes]) -> None:
                hostile.count("requests")
                for part in parts:
                    port.write(part)
                port.flush()
                port.reset_input_buffer()
                port.write(b"\nG,7,8\nP,0,0\n")
                assert port.read(1000).endswith(b"g\r\np\r\n")

            check()


IAC = rfc2217.IAC
COMMANDS = [
    rfc2217.SB,
    rfc2217.SE,
    rfc2217.DO,
    rfc2217.DONT,
    rfc2217.WILL,
    rfc2217.WONT,
    rfc2217.NOP,
]


def served(
    port: Rfc2217Port | TcpPort,
    connect: Callable[..., Any],
    request: bytes = b"B\n",
    limit: int = 256,
) -> None:
    """A client that comes, asks and is answered."""
    with connect(port) as client:
        client.setblocking(False)
        client.send(request)
        said = b""
        while request not in said:
            select.select(port.descriptors(room=True), (), (), 0.01)
            said += b"".join(port.receive(limit))
        port.write(b"b,reply\r\n")
        heard = b""
        while b"b,reply\r\n" not in heard:
            assert select.select((client,), (), (), 10)[0]
            heard += client.recv(4096)


@contextmanager
def connected(port: Rfc2217Port | TcpPort) -> Iterator[socket.socket]:
    with socket.create_connection(tcp_address(port.url.partition("//")[2]), timeout=10) as client:
        yield client


class TestConnections:
    """Data that clients of TCP and RFC 2217 send, and how they leave."""

    sent = st.lists(
        st.one_of(
            st.binary(max_size=50),
            st.builds(bytes.__add__, st.just(IAC), st.sampled_from(COMMANDS)),
            st.builds(
                lambda option, value: IAC + rfc2217.SB + b"," + option + value + IAC + rfc2217.SE,
                st.binary(max_size=1),
                st.binary(max_size=6),
            ),
            st.just(IAC + rfc2217.SB + b"x" * 200),
            st.sampled_from([b"N\n" * 5000, b"\r\0", b"\r"]),
        ),
        max_size=6,
    )
    leaving = st.sampled_from(["close", "half", "reset", "stay a little"])

    @pytest.mark.parametrize("kind", [TcpPort, Rfc2217Port])
    def test_do_not_keep_the_line_from_the_next(
        self,
        hostile: Hostile,
        monkeypatch: pytest.MonkeyPatch,
        kind: type[Rfc2217Port] | type[TcpPort],
    ) -> None:
        monkeypatch.setattr(tcp, "GRACE", 0.0)
        port = kind("127.0.0.1:0")

        @settings_of(hostile, 100)
        @given(
            st.lists(st.tuples(self.sent, self.leaving), min_size=1, max_size=3), st.integers(0, 1)
        )
        def check(clients: list[tuple[list[bytes], str]], room: int) -> None:
            for data, leaving in clients:
                hostile.count(f"{kind.scheme} clients")
                with connected(port) as client, suppress(OSError):
                    client.settimeout(0.2)
                    for piece in data:
                        client.sendall(piece)
                        port.receive(room)
                        port.write(b"\xffreply\r\n")
                    if leaving == "half":
                        client.shutdown(socket.SHUT_WR)
                    elif leaving == "reset":
                        client.setsockopt(
                            socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0)
                        )
                    port.receive(room)
            served(port, connected)
            while port._client:
                port.receive(256)

        check()
        port.close()


def cooked(settings: list[Any]) -> None:
    settings[0] |= termios.ICRNL | termios.IXON
    settings[3] |= termios.ICANON | termios.ECHO | termios.ISIG


def odd(settings: list[Any]) -> None:
    settings[2] = settings[2] & ~termios.CSIZE | termios.CS5 | termios.PARENB
    settings[4] = settings[5] = termios.B50


def hung_up(settings: list[Any]) -> None:
    settings[4] = settings[5] = termios.B0


def setting_of(change: Callable[[list[Any]], None]) -> Callable[[PtyPort, int], None]:
    def act(_: PtyPort, terminal: int) -> None:
        settings = termios.tcgetattr(terminal)
        change(settings)
        termios.tcsetattr(terminal, termios.TCSANOW, settings)

    return act


ACTS: dict[str, Callable[[PtyPort, int], object]] = {
    "cooked": setting_of(cooked),
    "odd": setting_of(odd),
    "hang up": setting_of(hung_up),
    "stop": lambda _, terminal: termios.tcflow(terminal, termios.TCOOFF),
    "own": lambda _, terminal: fcntl.ioctl(terminal, termios.TIOCEXCL),
    "flush": lambda _, terminal: termios.tcflush(terminal, termios.TCIOFLUSH),
    "break": lambda _, terminal: termios.tcsendbreak(terminal, 0),
    "discipline": lambda _, terminal: fcntl.ioctl(terminal, termios.TIOCSETD, struct.pack("i", 27)),
    "told": lambda port, _: port.write(b"n,1\r\n\x13\x03\x04"),
    "look": lambda port, _: port.receive(256),
}
"""Actions of a client, and events meanwhile."""


class TestTerminals:
    """Actions of clients on a pseudo-terminal, and what they leave behind."""

    def test_do_not_keep_the_line_from_the_next(self, hostile: Hostile, tmp_path: Path) -> None:
        acts = st.sampled_from(list(ACTS)) | st.binary(max_size=20)
        link_path = tmp_path / "khepera"

        @settings_of(hostile, 200)
        @given(st.lists(st.lists(acts, max_size=8), max_size=3))
        def check(clients: Sequence[list[bytes | str]]) -> None:
            with Link(link_path) as link:
                port = PtyPort(link.point_to)
                link.point_to(port.url)
                for each in clients:
                    hostile.count("terminal clients")
                    flags = os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK
                    terminal = os.open(port.url, flags)
                    with suppress(OSError, termios.error):
                        for what in each:
                            if isinstance(what, bytes):
                                os.write(terminal, what)
                            else:
                                ACTS[what](port, terminal)
                    os.close(terminal)
                while port.receive(256):
                    pass
                with serial.Serial(str(link_path), timeout=10, write_timeout=10) as client:
                    client.write(b"B\n")
                    said = b""
                    while not said.endswith(b"B\n"):
                        said += b"".join(port.receive(256))
                    port.write(b"b\r\n")
                    assert client.read_until(b"\n").endswith(b"b\r\n")
                port.close()

        check()
