"""TCP and RFC 2217: one client at a time, its bytes and settings, and what is refused."""

import select
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import pytest
import serial
from as_type import not_none
from serial import rfc2217

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.coding import LineFormat
from khepera_emulator.ports import tcp
from khepera_emulator.ports.opening import open_port
from khepera_emulator.ports.pty import PtyPort
from khepera_emulator.ports.rfc2217 import Rfc2217Port
from khepera_emulator.ports.tcp import TcpPort, tcp_address

PATIENCE = 30.0
MUCH = 4096
KINDS = pytest.mark.parametrize("port", [TcpPort, Rfc2217Port], indirect=True)


@pytest.fixture
def port(request: pytest.FixtureRequest) -> Iterator[Rfc2217Port | TcpPort]:
    opened = getattr(request, "param", TcpPort)("127.0.0.1:0")
    yield opened
    opened.close()


@contextmanager
def client(port: Rfc2217Port | TcpPort, **options: Any) -> Iterator[socket.socket]:
    host, number = tcp_address(port.url.partition("//")[2])
    with socket.create_connection((host, number), timeout=PATIENCE, **options) as connection:
        yield connection


def received(port: Rfc2217Port | TcpPort, count: int, limit: int = MUCH) -> list[bytes]:
    """Return what clients do, until there are so many bytes and goodbyes of it."""
    chunks: list[bytes] = []
    while sum(len(chunk) or 1 for chunk in chunks) < count:
        assert select.select(port.descriptors(room=True), (), (), PATIENCE)[0]
        chunks += port.receive(limit)
    return chunks


def admitted(port: Rfc2217Port | TcpPort, count: int = 1) -> None:
    """Wait for clients at the door and let them in, or not."""
    for _ in range(count):
        assert select.select(port.descriptors(room=False)[:1], (), (), PATIENCE)[0]
        assert port.receive(MUCH) == []


def all_of(connection: socket.socket) -> bytes:
    data = b""
    while more := connection.recv(MUCH):
        data += more
    return data


def exactly(connection: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        data += connection.recv(count - len(data))
    return data


class TestBytes:
    def test_pass_unchanged_in_both_directions(self, port: Rfc2217Port | TcpPort) -> None:
        every_byte = bytes(range(256))
        with client(port) as connection:
            connection.sendall(every_byte)
            assert received(port, 256) == [every_byte]
            port.write(every_byte)
            assert exactly(connection, 256) == every_byte

    def test_beyond_the_limit_stay_with_the_client(self, port: Rfc2217Port | TcpPort) -> None:
        with client(port) as connection:
            connection.sendall(b"abcdef")
            assert received(port, 4, 4) == [b"abcd"]
            assert port.receive(0) == []
            assert received(port, 2, 4) == [b"ef"]

    @KINDS
    def test_that_nobody_reads_are_dropped_and_counted(self, port: Rfc2217Port | TcpPort) -> None:
        with client(port):
            admitted(port)
            for _ in range(1000):
                port.write(b"x" * 10_000)
            assert port.dropped > 2_000_000

    @KINDS
    def test_to_nobody_are_no_loss(self, port: Rfc2217Port | TcpPort) -> None:
        port.write(b"x")
        assert port.receive(MUCH) == []


class TestClients:
    def test_leave_after_their_last_byte(self, port: Rfc2217Port | TcpPort) -> None:
        with client(port) as connection:
            connection.sendall(b"abcdef")
        assert received(port, 7, 4) == [b"abcd", b"ef", b""]

    @KINDS
    def test_beyond_the_first_are_told_why_and_turned_away(
        self, port: Rfc2217Port | TcpPort, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(tcp, "GRACE", 0.0)
        with client(port) as first:
            admitted(port)
            name = "{}:{}".format(*first.getsockname())
            for _ in range(3):
                with client(port) as second:
                    admitted(port)
                    said = all_of(second)
                assert said == (
                    f"the robot's line is in use by {name}: one client at a time\r\n".encode()
                )
            first.sendall(b"N\n")
            assert received(port, 2) == [b"N\n"]

    def test_wait_for_a_moment_for_one_that_is_about_to_leave(
        self, port: Rfc2217Port | TcpPort, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(tcp, "GRACE", PATIENCE)
        with client(port) as first:
            admitted(port)
            with client(port) as second:
                admitted(port)
                second.sendall(b"B\n")
                first.close()
                assert received(port, 3) == [b"", b"B\n"]
                port.write(b"b\r\n")
                assert exactly(second, 3) == b"b\r\n"

    def test_at_the_door_are_not_without_number(
        self, port: Rfc2217Port | TcpPort, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(tcp, "GRACE", PATIENCE)
        with client(port), ExitStack() as stack:
            admitted(port)
            crowd = []
            for _ in range(20):
                crowd.append(stack.enter_context(client(port)))
                admitted(port)
            assert all_of(crowd[3]).startswith(b"the robot's line is in use")
            assert not select.select(crowd[4:], (), (), 0)[0]

    def test_take_the_place_of_one_that_has_left_unseen(self, port: Rfc2217Port | TcpPort) -> None:
        with client(port) as first:
            admitted(port)
            first.sendall(b"O\nE\n")
        with client(port) as second:
            second.sendall(b"B\n")
            assert received(port, 7) == [b"O\nE\n", b"", b"B\n"]
            port.write(b"b\r\n")
            assert exactly(second, 3) == b"b\r\n"

    def test_that_leave_without_reading_have_their_requests_taken(
        self, port: Rfc2217Port | TcpPort
    ) -> None:
        with client(port) as connection:
            connection.sendall(b"N\n")
            assert received(port, 2) == [b"N\n"]
            port.write(b"n\r\n")
            connection.sendall(b"O\n")
        # they went with unread bytes: the system breaks the connection at once
        assert received(port, 3) == [b"O\n", b""]
        port.write(b"o\r\n")
        assert port.dropped == 0

    @KINDS
    def test_are_told_of_the_end(self, port: Rfc2217Port | TcpPort) -> None:
        with client(port) as connection:
            admitted(port)
            port.close()
            all_of(connection)

    @KINDS
    def test_that_end_their_sending_side_have_the_line_until_all_is_said(
        self, port: Rfc2217Port | TcpPort
    ) -> None:
        with client(port) as connection:
            connection.sendall(b"B\n")
            connection.shutdown(socket.SHUT_WR)
            assert received(port, 2) == [b"B\n"]
            assert port.receive(MUCH, answered=False) == []
            port.write(b"b\r\n")
            assert port.receive(MUCH, answered=False) == []
            assert received(port, 1) == [b""]
            assert all_of(connection).endswith(b"b\r\n")

    def test_that_only_listen_give_way_to_another_one(
        self, port: Rfc2217Port | TcpPort, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(tcp, "GRACE", 0.0)
        with client(port) as first:
            first.sendall(b"B\n")
            first.shutdown(socket.SHUT_WR)
            assert received(port, 2) == [b"B\n"]
            assert port.receive(MUCH, answered=False) == []
            with client(port) as second:
                second.sendall(b"H\n")
                assert select.select(port.descriptors(room=True, answered=False), (), (), PATIENCE)[
                    0
                ]
                chunks = port.receive(MUCH, answered=False)
                chunks += received(port, 3 - sum(len(each) or 1 for each in chunks))
                assert chunks == [b"", b"H\n"]
                assert all_of(first) == b""
                port.write(b"h\r\n")
                assert exactly(second, 3) == b"h\r\n"

    @KINDS
    def test_that_left_much_behind_do_not_keep_the_line(self, port: Rfc2217Port | TcpPort) -> None:
        much = b"N\n" * 1_500_000  # an hour at 9600

        def write_and_leave() -> None:
            with client(port) as first:
                first.sendall(much)

        thread = threading.Thread(target=write_and_leave)
        thread.start()
        chunks: list[bytes] = []
        while thread.is_alive():  # the line has room for nothing of it
            chunks += port.receive(0, answered=False)
        with client(port) as second:
            while b"" not in chunks:
                chunks += port.receive(0, answered=False)
            *rest, _ = chunks
            # who has not read all that came breaks the connection, and what is on it may be lost
            assert rest == [much] if type(port) is TcpPort else much.startswith(b"".join(rest))
            second.sendall(b"H\n")
            assert received(port, 2) == [b"H\n"]
        thread.join(PATIENCE)

    def test_that_write_without_end_are_held_back(
        self, port: Rfc2217Port | TcpPort, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(tcp, "_AHEAD", 100_000)
        with client(port) as connection:
            connection.setblocking(False)
            admitted(port)
            sent = 0
            while True:
                try:
                    sent += connection.send(b"N\n" * 1000)
                except BlockingIOError:
                    if not select.select(port.descriptors(room=False), (), (), 0.1)[0]:
                        break
                port.receive(0)
            assert len(port._ahead) < 200_000
            assert sent > 100_000
            taken = 0
            while taken < sent:  # nothing is lost
                [chunk] = received(port, 1, 3000)
                taken += len(chunk)

    def test_that_wrote_too_much_give_way_to_another_one(
        self, port: Rfc2217Port | TcpPort, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(tcp, "_AHEAD", 1000)
        monkeypatch.setattr(tcp, "GRACE", 0.0)
        with client(port) as first:
            first.sendall(b"N\n" * 50_000)
            while len(port._ahead) < 1000:
                assert port.receive(0, answered=False) == []
            with client(port) as second:
                second.sendall(b"H\n")
                chunks: list[bytes] = []
                while b"" not in chunks:
                    chunks += port.receive(0, answered=False)
                assert received(port, 2) == [b"H\n"]

    def test_may_come_and_go_often(self, port: Rfc2217Port | TcpPort) -> None:
        for turn in range(100):
            with client(port) as connection:
                connection.sendall(b"%03d\n" % turn)
            assert received(port, 5) == [b"%03d\n" % turn, b""]


class TestLog:
    """At the level `info` it is told who comes and goes, and what is refused."""

    def test_tells_who_comes_and_goes_and_who_is_turned_away(
        self,
        port: Rfc2217Port | TcpPort,
        monkeypatch: pytest.MonkeyPatch,
        caplog: pytest.LogCaptureFixture,
    ) -> None:
        monkeypatch.setattr(tcp, "GRACE", 0.0)
        caplog.set_level("INFO")
        with client(port) as first:
            admitted(port)
            with client(port) as second:
                admitted(port)
                names = ["{}:{}".format(*each.getsockname()) for each in (first, second)]
        assert received(port, 1) == [b""]
        assert [record.getMessage() for record in caplog.records] == [
            f"{port.url}: {names[0]} has the line",
            f"{port.url}: {names[1]} turned away: {names[0]} has the line",
            f"{port.url}: {names[0]} has left",
        ]

    @pytest.mark.parametrize("port", [Rfc2217Port], indirect=True)
    @pytest.mark.parametrize(
        ("data", "told"),
        [
            (rfc2217.SET_BAUDRATE + b"\xfe" * 4, "wants a rate of 4278124286, which is refused"),
            (rfc2217.SET_DATASIZE + b"\x63", "wants 99 data bits, which is refused"),
            (rfc2217.SET_PARITY + b"\x63", "wants the option 2c 03 63, which is refused"),
        ],
    )
    def test_tells_which_settings_are_refused(
        self, port: Rfc2217Port | TcpPort, caplog: pytest.LogCaptureFixture, data: bytes, told: str
    ) -> None:
        caplog.set_level("INFO")
        with client(port) as connection:
            option = setting(data[:1], data[1:].replace(b"\xff", b"\xff\xff"))
            connection.sendall(option * 100 + b"B\n")
            assert received(port, 2) == [b"B\n"]
            name = "{}:{}".format(*connection.getsockname())
        told_all = [each.getMessage() for each in caplog.records if "refused" in each.getMessage()]
        assert told_all == [f"{port.url}: {name} {told}"] * 20


IAC_SB = rfc2217.IAC + rfc2217.SB
IAC_SE = rfc2217.IAC + rfc2217.SE


def setting(option: bytes, value: bytes) -> bytes:
    return IAC_SB + rfc2217.COM_PORT_OPTION + option + value + IAC_SE


@pytest.mark.parametrize("port", [Rfc2217Port], indirect=True)
class TestTelnet:
    @staticmethod
    def taken(port: Rfc2217Port | TcpPort, connection: socket.socket, data: bytes) -> bytes:
        """Bytes for the robot in what a client sends; the marker says that all has come."""
        connection.sendall(data + b"\x00end")
        seen = b""
        while not seen.endswith(b"\x00end"):
            [chunk] = received(port, 1)
            seen += chunk
        return seen[:-4]

    def test_settings_are_the_clients(self, port: Rfc2217Port | TcpPort) -> None:
        assert port.settings() == LineFormat(9600)
        with client(port) as connection:
            data = (
                setting(rfc2217.SET_BAUDRATE, (38400).to_bytes(4, "big"))
                + b"B"
                + setting(rfc2217.SET_DATASIZE, b"\x07")
                + setting(rfc2217.SET_PARITY, b"\x03")
                + setting(rfc2217.SET_STOPSIZE, b"\x02")
            )
            assert self.taken(port, connection, data) == b"B"
            assert port.settings() == LineFormat(38400, 7, "E", 2)

    def test_every_byte_passes_in_both_directions(self, port: Rfc2217Port | TcpPort) -> None:
        every_byte = bytes(range(256))
        escaped = every_byte.replace(b"\xff", b"\xff\xff")
        with client(port) as connection:
            assert self.taken(port, connection, escaped) == every_byte
            assert b"".join(self.taken(port, connection, bytes([b])) for b in b"N\n") == b"N\n"
            port.write(every_byte)
            port.close()
            assert all_of(connection).endswith(escaped)

    @pytest.mark.parametrize(
        "nonsense",
        [
            IAC_SE,
            setting(rfc2217.SET_BAUDRATE, b"\x01"),
            setting(rfc2217.SET_BAUDRATE, b"\xfe" * 4),
            setting(rfc2217.SET_PARITY, b"\x63"),
            setting(rfc2217.SET_DATASIZE, b"\x63"),
            setting(rfc2217.SET_STOPSIZE, b"\x63"),
            setting(rfc2217.SET_LINESTATE_MASK, b""),
            setting(b"\x63", b"x" * 10),
            IAC_SB + IAC_SE,
            rfc2217.IAC + rfc2217.DO + b"\x63" + rfc2217.IAC + rfc2217.WILL + b"\x63",
            rfc2217.IAC + b"\x00",
        ],
    )
    def test_nonsense_changes_nothing(self, port: Rfc2217Port | TcpPort, nonsense: bytes) -> None:
        with client(port) as connection:
            assert self.taken(port, connection, nonsense + b"B\n") == b"B\n"
            assert port.settings() == LineFormat(9600)

    def test_an_option_without_an_end_is_forgotten(self, port: Rfc2217Port | TcpPort) -> None:
        with client(port) as connection:
            assert self.taken(port, connection, IAC_SB + b"x" * 1000 + b"B\n").endswith(b"xB\n")

    def test_a_client_that_never_reads_is_dropped_in_the_end(
        self, port: Rfc2217Port | TcpPort
    ) -> None:
        ask = setting(rfc2217.SET_BAUDRATE, bytes(4)) * 100
        with client(port) as connection:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            admitted(port)
            connection.setblocking(False)
            goodbye: list[bytes] = []
            while not goodbye:
                select.select((), (connection,), (), 0.01)
                with suppress(OSError):
                    connection.send(ask)
                goodbye = [chunk for chunk in port.receive(1 << 16) if not chunk]

    def test_no_escape_is_cut_in_half(self, port: Rfc2217Port | TcpPort) -> None:
        with client(port) as connection:
            admitted(port)
            written = 0
            while not port.dropped:
                port.write(b"\xff" * 1001)
                written += 1001
            kept = written - port.dropped
            data = b""
            while (start := data.find(b"\xff" * 8)) < 0 or len(data) - start < 2 * kept:
                data += connection.recv(1 << 16)
                port.receive(MUCH)
            port.write(b"x")
            port.close()
            data += all_of(connection)
        assert data[start:] == b"\xff" * (2 * kept) + b"x"

    def test_settings_are_seen_behind_bytes_that_wait(self, port: Rfc2217Port | TcpPort) -> None:
        with client(port) as connection:
            admitted(port)
            connection.sendall(b"N\n" * 50_000)
            connection.sendall(setting(rfc2217.SET_BAUDRATE, (38400).to_bytes(4, "big")))
            while not_none(port.settings()).baud != 38400:
                assert select.select(port.descriptors(room=False), (), (), PATIENCE)[0]
                assert port.receive(0) == []
            assert port.receive(4) == [b"N\nN\n"]

    @pytest.mark.parametrize(
        ("what", "rest"),
        [
            (rfc2217.PURGE_TRANSMIT_BUFFER, b""),
            (rfc2217.PURGE_BOTH_BUFFERS, b""),
            (rfc2217.PURGE_RECEIVE_BUFFER, b"N\nO\n"),
        ],
    )
    def test_what_waits_can_be_taken_back(
        self, port: Rfc2217Port | TcpPort, what: bytes, rest: bytes
    ) -> None:
        with client(port) as connection:
            data = b"N\nO\n" + setting(rfc2217.PURGE_DATA, what) + b"B\n"
            assert self.taken(port, connection, data) == rest + b"B\n"

    @pytest.mark.parametrize(
        ("pieces", "meant"),
        [
            ((b"B\r\0H\r\0",), b"B\rH\r"),
            ((b"B\r", b"\0H\r\n"), b"B\rH\r\n"),
            ((b"B\r", b"\0\0"), b"B\r\0"),
            ((b"B\r" + rfc2217.IAC + rfc2217.NOP, b"\0H\n"), b"B\rH\n"),
            ((b"B\n\0",), b"B\n\0"),
            ((rfc2217.IAC + rfc2217.WILL + rfc2217.BINARY, b"B\r\0"), b"B\r\0"),
        ],
    )
    def test_a_nul_behind_a_return_is_dropped_unless_the_line_is_binary(
        self, port: Rfc2217Port | TcpPort, pieces: tuple[bytes, ...], meant: bytes
    ) -> None:
        with client(port) as connection:
            admitted(port)
            for piece in pieces:
                connection.sendall(piece)
                while select.select([not_none(port._client)], (), (), 0.05)[0]:
                    port.receive(0)
            assert self.taken(port, connection, b"") == meant

    @pytest.mark.filterwarnings("ignore::DeprecationWarning")
    def test_pyserial_opens_it(self, port: Rfc2217Port | TcpPort) -> None:
        """The whole of pySerial's negotiation, with its own client."""
        seen = []

        def serve() -> None:
            while b"" not in seen:
                select.select(port.descriptors(room=True), (), (), PATIENCE)
                seen.extend(port.receive(MUCH))

        thread = threading.Thread(target=serve)
        thread.start()
        with serial.serial_for_url(port.url, baudrate=19200, parity="O", bytesize=7) as there:
            assert port.settings() == LineFormat(19200, 7, "O", 1)
            there.baudrate = 57600
            there.dtr = there.rts = False
            there.reset_input_buffer()
            assert port.settings() == LineFormat(57600, 7, "O", 1)
            assert (there.cts, there.dsr, there.ri, there.cd) == (False,) * 4
            there.write(b"\xffB\n")
        thread.join(PATIENCE)
        assert b"".join(seen) == b"\xffB\n"


class TestAddress:
    @pytest.mark.parametrize(
        ("text", "parts"),
        [
            ("127.0.0.1:4000", ("127.0.0.1", 4000)),
            ("localhost:0", ("localhost", 0)),
            ("[::1]:65535", ("::1", 65535)),
        ],
    )
    def test_is_host_and_port(self, text: str, parts: tuple[str, int]) -> None:
        assert tcp_address(text) == parts

    @pytest.mark.parametrize(
        "text",
        [
            "",
            "4000",
            ":4000",
            "host:",
            "host:x",
            "h:65536",
            "h:-1",
            "h:" + "1" * 5000,
            "\x1b" * 999,
        ],
    )
    def test_is_nothing_else(self, text: str) -> None:
        with pytest.raises(EmulatorError, match="give HOST:PORT") as refused:
            tcp_address(text)
        assert str(refused.value).isprintable()
        assert len(str(refused.value)) < 350

    @pytest.mark.parametrize("address", ["0.0.0.0:0", "[::]:0"])
    def test_beyond_this_machine_has_to_be_allowed(self, address: str) -> None:
        with pytest.raises(EmulatorError, match="add --expose"):
            TcpPort(address)
        try:
            port = TcpPort(address, expose=True)
        except EmulatorError as error:
            pytest.skip(str(error))  # a machine without IPv6
        port.close()

    def test_in_use_is_refused(self, port: Rfc2217Port | TcpPort) -> None:
        with pytest.raises(EmulatorError, match=r"cannot listen on 127.0.0.1:\d+: Address already"):
            TcpPort(port.url.partition("//")[2])

    def test_of_nobody_is_refused(self) -> None:
        with pytest.raises(EmulatorError, match="no address nowhere"):
            TcpPort("nowhere.invalid:1")

    @pytest.mark.parametrize("host", ["x" * 64, "a..b", "x" * 300])
    def test_with_a_label_that_is_none_is_refused(self, host: str) -> None:
        with pytest.raises(EmulatorError, match=r"no address [a-x.]{4,60}…?"):
            TcpPort(f"{host}:1")


class TestChoice:
    @pytest.mark.parametrize(
        ("options", "kind"),
        [
            ({}, PtyPort),
            ({"tcp": "127.0.0.1:0"}, TcpPort),
            ({"rfc2217": "127.0.0.1:0"}, Rfc2217Port),
        ],
    )
    def test_is_one_port(
        self, options: dict[str, Any], kind: type[PtyPort] | type[TcpPort]
    ) -> None:
        port = open_port(**options)
        assert type(port) is kind
        port.close()

    def test_is_not_two(self) -> None:
        with pytest.raises(EmulatorError, match="a robot has one line"):
            open_port(tcp="127.0.0.1:0", rfc2217="127.0.0.1:0")
