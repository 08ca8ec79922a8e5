"""The emulator as a process on a real pseudo-terminal, with the habits of real clients."""

import fcntl
import os
import resource
import select
import signal
import socket
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import serial
from as_type import not_none
from emulator_process import COMMAND, PATIENCE, EmulatorProcess, emulator, link_options
from khepera_protocol.serial.units import wire_time
from unprivileged import enter_from_outside

import khepera_emulator  # noqa: F401 - registers khepera://
from khepera_emulator.app.cli.program import run
from khepera_emulator.app.daemon import Daemon, _Line
from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.body.drift import PRESETS
from khepera_emulator.line.clock import Clock
from khepera_emulator.line.dialect import KHEPERA
from khepera_emulator.ports import tcp
from khepera_emulator.ports.pty import PtyPort
from khepera_emulator.ports.tcp import TcpPort, tcp_address
from khepera_emulator.robot.emulator import Emulator, Setup

VERSION = b"b,5.01,5.00\r\n"


@pytest.fixture(scope="module")
def paced(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmulatorProcess]:
    """An emulator at 9600 with a link."""
    with emulator(
        *link_options(tmp_path_factory.mktemp("paced")), "--baud", "9600", "--drift", "none"
    ) as running:
        yield running


@pytest.fixture(scope="module")
def unpaced() -> Iterator[EmulatorProcess]:
    with emulator("--no-zenoh", "--baud", "unpaced", "--drift", "none") as running:
        yield running


def link_of(running: EmulatorProcess) -> str:
    return running.announcement.partition("link ")[2]


def connect(running: EmulatorProcess, **settings: Any) -> serial.Serial:
    return serial.Serial(running.path, timeout=PATIENCE, **settings)


def ask(port: serial.SerialBase, request: bytes) -> bytes:
    port.write(request)
    return port.read_until(b"\n")


def counters(port: serial.Serial) -> tuple[int, int]:
    left, right = ask(port, b"H\n").decode().strip().split(",")[1:]
    return int(left), int(right)


class TestClients:
    def test_open_the_link_that_was_announced(self, paced: EmulatorProcess) -> None:
        link = link_of(paced)
        assert paced.announcement == f"khepera on {paced.path}, link {link}"
        assert str(Path(link).readlink()) == paced.path
        with serial.Serial(link, timeout=PATIENCE) as port:
            assert ask(port, b"B\n") == VERSION

    def test_may_be_a_shell(self, paced: EmulatorProcess) -> None:
        script = (
            'exec 3<>"$0"; stty raw -echo <&3; printf "B\\n" >&3;'
            ' IFS= read -r reply <&3; printf "%s\\n" "$reply"'
        )
        done = subprocess.run(
            ["sh", "-c", script, link_of(paced)], capture_output=True, timeout=PATIENCE, check=True
        )
        assert done.stdout == VERSION

    def test_may_write_and_read_through_different_openings(self, paced: EmulatorProcess) -> None:
        with connect(paced) as reader:
            subprocess.run(
                ["sh", "-c", 'printf "B\\n" > "$0"', link_of(paced)], timeout=PATIENCE, check=True
            )
            assert reader.read_until(b"\n") == VERSION

    def test_find_no_reply_to_the_one_before(self, paced: EmulatorProcess) -> None:
        for _ in range(5):
            with connect(paced) as port:
                port.write(b"N\n" * 4)
                assert port.read(1) == b"n"  # the rest is on its way or still to be made
            with connect(paced) as port:
                assert ask(port, b"B\n") == VERSION

    def test_may_be_killed(self, unpaced: EmulatorProcess) -> None:
        victim = subprocess.Popen(
            [
                *(sys.executable, "-c"),
                "import serial, sys\n"
                "port = serial.Serial(sys.argv[1], timeout=None)\n"
                "port.write(b'D,5,5\\n'); port.read(3); print(flush=True); port.read(1)\n",
                unpaced.path,
            ],
            stdout=subprocess.PIPE,
        )
        not_none(victim.stdout).readline()
        victim.kill()
        victim.communicate(timeout=PATIENCE)
        with connect(unpaced) as port:
            first = counters(port)
            # no watchdog: the robot drives on
            deadline = time.monotonic() + PATIENCE
            while counters(port) <= first and time.monotonic() < deadline:
                pass
            assert counters(port) > first
            assert ask(port, b"D,0,0\n") == b"d\r\n"


class TestNetwork:
    @pytest.mark.parametrize("scheme", ["socket", "rfc2217"])
    @pytest.mark.filterwarnings("ignore::DeprecationWarning")
    def test_url_that_was_announced_can_be_opened(self, scheme: str) -> None:
        option = "--tcp" if scheme == "socket" else "--rfc2217"
        with emulator("--no-zenoh", option, "127.0.0.1:0") as running:
            assert running.announcement.startswith(f"khepera on {scheme}://127.0.0.1:")
            with serial.serial_for_url(running.path, timeout=PATIENCE) as port:
                assert ask(port, b"B\n") == VERSION

    @pytest.mark.parametrize("baud", ["9600", "unpaced"])
    def test_who_only_ends_the_sending_side_is_answered_all(self, baud: str) -> None:
        """As `printf 'B\\nH\\n' | nc -N 127.0.0.1 4000` does."""
        with emulator("--no-zenoh", "--tcp", "127.0.0.1:0", "--baud", baud) as running:
            for _ in range(3):
                with connection(running) as client:
                    client.sendall(b"B\nH\n" * 3)
                    client.shutdown(socket.SHUT_WR)
                    assert client.makefile("rb").read() == (VERSION + b"h,0,0\r\n") * 3

    def test_who_has_left_hours_behind_does_not_keep_the_line(self) -> None:
        with emulator("--no-zenoh", "--tcp", "127.0.0.1:0", "--speed", "20") as running:
            with connection(running) as client:
                client.sendall(b"G,7,8\n" + b"N\n" * 1_500_000)
            with connection(running) as client:
                client.sendall(b"\nH\n")
                assert client.makefile("rb").readline() == b"h,7,8\r\n"


def connection(running: EmulatorProcess) -> socket.socket:
    host, _, port = running.path.rpartition("/")[2].rpartition(":")
    return socket.create_connection((host, int(port)), PATIENCE)


class TestWireTime:
    """Lower bounds only: a busy machine may always be late."""

    @staticmethod
    def duration(port: serial.Serial, request: bytes) -> tuple[float, int]:
        start = time.monotonic()
        reply = ask(port, request)
        return time.monotonic() - start, len(request) + len(reply)

    @pytest.mark.parametrize("request_line", [b"N\n", b"B\n", b"D,0,0\n"])
    def test_no_reply_is_early_at_a_fixed_rate(
        self, paced: EmulatorProcess, request_line: bytes
    ) -> None:
        with connect(paced) as port:
            for _ in range(3):
                took, characters = self.duration(port, request_line)
                assert took >= wire_time(characters, 9600) + KHEPERA.busy

    def test_rate_follows_the_client(self) -> None:
        with emulator("--no-zenoh") as running:
            for rate in (1200, 9600, 38400):
                with connect(running, baudrate=rate) as port:
                    took, characters = self.duration(port, b"B\n")
                    assert took >= wire_time(characters, rate) + KHEPERA.busy

    def test_runs_faster_with_the_clock(self) -> None:
        with (
            emulator("--no-zenoh", "--speed", "20", "--baud", "50") as running,
            connect(running, baudrate=50) as port,
        ):
            took, characters = self.duration(port, b"B\n")
        assert took >= (wire_time(characters, 50) + KHEPERA.busy) / 20
        assert took < wire_time(characters, 50)


class TestAnotherRate:
    def test_reads_and_sends_garbage(self) -> None:
        emulated = Emulator(Setup(load_arena("corridor"), baud=9600))
        port = PtyPort()
        line = _Line(emulated, port, False, None, None)

        def exchange(client: serial.Serial, request: bytes) -> bytes:
            client.write(request)
            line.look(set())
            line.take(emulated.now)
            emulated.advance(emulated.now + 1.0)
            count = emulated.uart.queued()
            line.hand_over()
            return client.read(count)

        with serial.Serial(port.url, 19200, timeout=PATIENCE) as client:
            assert b"g\r\n" not in exchange(client, b"G,7,8\n" * 4)
            assert exchange(client, b"B\n") != VERSION
        with serial.Serial(port.url, 9600, timeout=PATIENCE) as client:
            exchange(client, b"\n")  # the garbage may have left half a line behind
            assert exchange(client, b"B\n") == VERSION
            assert exchange(client, b"H\n") == b"h,0,0\r\n"
        port.close()
        emulated.close()

    def test_within_five_per_cent_reads_clean(self, paced: EmulatorProcess) -> None:
        for rate in (9120, 10080):
            with connect(paced, baudrate=rate) as port:
                assert ask(port, b"B\n") == VERSION

    @pytest.mark.filterwarnings("ignore::DeprecationWarning")
    def test_or_parity_or_size_counts_over_rfc2217(self) -> None:
        with (
            emulator("--no-zenoh", "--rfc2217", "127.0.0.1:0", "--baud", "9600") as running,
            serial.serial_for_url(running.path, timeout=PATIENCE) as port,
        ):
            assert ask(port, b"B\n") == VERSION
            port.parity = "E"
            port.write(b"B\n")
            assert port.read(len(VERSION)) == bytes(
                byte * (byte.bit_count() % 2) for byte in VERSION
            )
            port.parity = "N"
            port.bytesize = 7
            port.timeout = 0.3
            port.write(b"B\n")
            assert VERSION not in port.read(100)


class TestSameRobotAsInProcess:
    # What a robot at rest says does not depend on when it is asked, except for the sensors'
    # noise: that changes with every scan of 20 ms. At 9600 an N takes longer than a scan lasts,
    # so each N and each O reads a scan of its own, and the draws come in the same order.
    SCRIPT = (
        b"B A,3000,700,90 D,0,0 G,5,-7 H E K N N O N J,10,32,10,32 F,3000,20,4000 L,0,1 L,1,2"
        b" I,0 I,9 P,0,0 R,3 W,1,3 T,1,B D,1 M C restart H"
    ).split()

    @pytest.mark.parametrize("model", ["khepera", "khepera2"])
    def test_gives_the_same_replies(self, model: str) -> None:
        with (
            emulator("--no-zenoh", "--seed", "1", "--model", model, "--baud", "9600") as running,
            connect(running) as there,
            serial.serial_for_url(f"khepera://corridor?seed=1&model={model}", timeout=1) as here,
        ):
            for request in self.SCRIPT:
                expected = ask(here, request + b"\n")
                assert ask(there, request + b"\n") == expected
                if request == b"restart":
                    assert there.read_until(b"\n") == here.read_until(b"\n")


class TestEnd:
    @pytest.mark.parametrize(
        ("number", "status"),
        [
            (signal.SIGTERM, 0),
            (signal.SIGHUP, 0),
            (signal.SIGINT, 130),
            (signal.SIGQUIT, 130),
        ],
    )
    def test_signal_ends_it_cleanly(
        self, tmp_path: Path, number: signal.Signals, status: int
    ) -> None:
        running = EmulatorProcess(*link_options(tmp_path))
        assert [entry.name for entry in sorted(tmp_path.iterdir())] == [
            ".khepera.khepera-emulator-lock",
            "khepera",
        ]
        assert running.end(number) == (status, "")
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize(
        ("number", "status"),
        [
            (signal.SIGTERM, 0),
            (signal.SIGHUP, 0),
            (signal.SIGINT, 130),
            (signal.SIGQUIT, 130),
        ],
    )
    @pytest.mark.parametrize("step", ["load_arena", "make_robots", "open_port"])
    def test_signal_ends_it_cleanly_before_it_is_ready(
        self, tmp_path: Path, number: signal.Signals, status: int, step: str
    ) -> None:
        """A signal that comes with one of the steps to a running robot."""
        module = "robot.options" if step == "load_arena" else "app.serving"
        script = (
            "import os, sys, khepera_emulator.app.serving, khepera_emulator.robot.options\n"
            "from khepera_emulator.app.cli import main\n"
            f"module = khepera_emulator.{module}\n"
            f"do = module.{step}\n"
            "def disturbed(*arguments, **options):\n"
            f"    os.kill(os.getpid(), {int(number)})\n"
            "    return do(*arguments, **options)\n"
            f"module.{step} = disturbed\n"
            "main()\n"
        )
        command = [sys.executable, "-c", script, "run", *link_options(tmp_path)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
        assert done.returncode == status
        assert "Traceback" not in done.stderr
        assert list(tmp_path.iterdir()) == []

    def test_closed_terminal_does_not_end_what_nohup_started(self, tmp_path: Path) -> None:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        try:
            running = EmulatorProcess(*link_options(tmp_path))
        finally:
            signal.signal(signal.SIGHUP, signal.SIG_DFL)
        running.process.send_signal(signal.SIGHUP)
        with connect(running) as port:
            assert ask(port, b"B\n") == VERSION
        assert running.end() == (0, "")

    @pytest.mark.pybullet
    @pytest.mark.parametrize("closed", [(0,), (1,), (2,), (0, 1, 2)])
    def test_closed_standard_files_do_no_harm(
        self, tmp_path: Path, closed: tuple[int, ...]
    ) -> None:
        shell = 'exec "$0" "$@" ' + " ".join(f"{number}>&-" for number in closed)
        options = (*link_options(tmp_path), "--log-level", "info", "--robots", "2")
        process = subprocess.Popen(["sh", "-c", shell, *COMMAND, *options])
        try:
            for name in ("khepera-1", "khepera-2"):
                with serial.Serial(awaited(tmp_path / name), timeout=PATIENCE) as port:
                    assert ask(port, b"B\n") == VERSION
                    assert ask(port, b"H\n") == b"h,0,0\r\n"
            for number in closed:  # a library that prints does not print on the line
                assert str(Path(f"/proc/{process.pid}/fd/{number}").readlink()) == os.devnull
        finally:
            process.terminate()
            assert process.wait(PATIENCE) == 0
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.pybullet
    def test_nobody_who_reads_what_it_says_does_no_harm(self, tmp_path: Path) -> None:
        reader, writer = os.pipe()
        os.close(reader)
        options = (*link_options(tmp_path), "--log-level", "info", "--robots", "2")
        process = subprocess.Popen([*COMMAND, *options], stdout=writer, stderr=writer)
        os.close(writer)
        try:
            with serial.Serial(awaited(tmp_path / "khepera-2"), timeout=PATIENCE) as port:
                assert ask(port, b"B\n") == VERSION
        finally:
            process.terminate()
            assert process.wait(PATIENCE) == 0

    def test_a_thousand_descriptors_of_the_parent_do_no_harm(self, tmp_path: Path) -> None:
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        if hard < 1500:
            pytest.skip("this system does not give so many")
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 1500), hard))
        with ExitStack() as stack:
            stack.callback(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
            inherited = [stack.enter_context(Path(os.devnull).open()).fileno() for _ in range(1100)]
            process = subprocess.Popen(
                [*COMMAND, *link_options(tmp_path)], pass_fds=inherited, stdout=subprocess.PIPE
            )
        assert not_none(process.stdout).readline().startswith(b"khepera on ")
        try:
            with serial.Serial(str(tmp_path / "khepera"), timeout=PATIENCE) as port:
                assert ask(port, b"B\n") == VERSION
        finally:
            process.terminate()
            process.communicate(timeout=PATIENCE)
        assert process.returncode == 0

    def test_client_is_told(self, tmp_path: Path) -> None:
        running = EmulatorProcess(*link_options(tmp_path))
        with connect(running) as port:
            running.end()
            with pytest.raises(serial.SerialException, match=r"read failed|no data"):
                port.read(1)

    def test_link_in_use_is_refused_and_kept(self, paced: EmulatorProcess) -> None:
        second = subprocess.run(
            [*COMMAND, "--no-zenoh", "--link", link_of(paced)],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        assert second.returncode == 2
        assert second.stdout == ""
        assert second.stderr == (
            f"khepera-emulator: the link {link_of(paced)} is held by an emulator that is running;"
            " end that one, or give another --link\n"
        )
        with serial.Serial(link_of(paced), timeout=PATIENCE) as port:
            assert ask(port, b"B\n") == VERSION

    def test_link_of_a_killed_emulator_is_taken_over(self, tmp_path: Path) -> None:
        EmulatorProcess(*link_options(tmp_path)).end(signal.SIGKILL)
        assert (tmp_path / "khepera").is_symlink()
        with (
            emulator(*link_options(tmp_path)),
            serial.Serial(str(tmp_path / "khepera"), timeout=PATIENCE) as port,
        ):
            assert ask(port, b"B\n") == VERSION


def awaited(path: Path) -> str:
    """A link that is about to be made."""
    deadline = time.monotonic() + PATIENCE
    while not path.is_symlink():
        assert time.monotonic() < deadline
    return str(path)


UNPRIVILEGED = """
import sys
import serial
from unprivileged import give_up_root
from khepera_emulator.arenas.arena import arena_names
from khepera_emulator.app.cli import commands
from khepera_emulator.app.cli import program
from khepera_emulator.app import daemon
from khepera_emulator.robot import emulator
from khepera_emulator.app import serving
from khepera_emulator.app import side_channel
from khepera_emulator.ports import pty
arena_names()
give_up_root()
sys.exit(program.run())
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become nobody")
class TestUnprivileged:
    """An emulator whose user may not open what a client has taken for itself."""

    def test_robot_lives_on_when_a_client_has_taken_its_terminal_for_ever(
        self, tmp_path: Path
    ) -> None:
        enter_from_outside(tmp_path)
        tmp_path.chmod(0o777)
        link = tmp_path / "khepera"
        process = subprocess.Popen(
            [sys.executable, "-c", UNPRIVILEGED, "run", *link_options(tmp_path)],
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parent)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            first = not_none(process.stdout).readline().partition(" on ")[2].partition(",")[0]
            with serial.Serial(first, timeout=PATIENCE) as port:
                assert ask(port, b"G,7,8\n") == b"g\r\n"
                fcntl.ioctl(port.fileno(), termios.TIOCEXCL)
            deadline = time.monotonic() + PATIENCE
            while str(link.readlink()) == first:
                assert time.monotonic() < deadline
            with serial.Serial(str(link), timeout=PATIENCE) as port:
                assert ask(port, b"H\n") == b"h,7,8\r\n"
        finally:
            process.terminate()
            _, said = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0
        assert "unusable (Device or resource busy), as by TIOCEXCL: the line has moved to" in said
        assert list(tmp_path.iterdir()) == []


class TestCommandLine:
    @staticmethod
    def run(
        monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], *arguments: str
    ) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["khepera-emulator", *arguments])
        status = run()
        out, err = capfd.readouterr()
        return status, out, err

    @pytest.mark.parametrize(
        ("options", "sentence"),
        [
            (["--arena", "nowhere"], "unknown arena 'nowhere'"),
            (["--model", "lego"], "there is no robot model 'lego'; there are khepera"),
            (["--drift", "much"], "cannot read the drift 'much'"),
            (["--baud", "fast"], "--baud: 'fast' is no rate; give auto, unpaced, or a rate"),
            (["--robot", "a/b"], "--robot: 'a/b': a name is made of letters"),
            (["--zenoh", "--listen", "nonsense"], "cannot open a Zenoh session on nonsense"),
            (["--tcp", "127.0.0.1:0"], "--link points to a terminal"),
        ],
    )
    def test_error_is_one_sentence_and_leaves_nothing(
        self,
        monkeypatch: pytest.MonkeyPatch,
        capfd: pytest.CaptureFixture[str],
        tmp_path: Path,
        options: list[str],
        sentence: str,
    ) -> None:
        status, out, err = self.run(monkeypatch, capfd, "run", *link_options(tmp_path), *options)
        assert (status, out) == (2, "")
        assert err.startswith(f"khepera-emulator: {sentence}")
        assert err.count("\n") == 1
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize(
        ("options", "sentence"),
        [
            (["--tcp", "4000"], "'4000' is no address; give HOST:PORT"),
            (["--rfc2217", "0.0.0.0:0"], "0.0.0.0:0 can be reached from other machines"),
            (["--tcp", "127.0.0.1:0", "--rfc2217", "127.0.0.1:0"], "--port, --tcp and --rfc2217:"),
        ],
    )
    def test_port_that_cannot_be_is_one_sentence(
        self,
        monkeypatch: pytest.MonkeyPatch,
        capfd: pytest.CaptureFixture[str],
        options: list[str],
        sentence: str,
    ) -> None:
        status, out, err = self.run(monkeypatch, capfd, "run", "--no-zenoh", *options)
        assert (status, out) == (2, "")
        assert err.startswith(f"khepera-emulator: {sentence}")
        assert err.count("\n") == 1

    def test_file_at_the_place_of_the_link_is_kept(
        self, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        (tmp_path / "khepera").write_text("precious")
        status, _, err = self.run(monkeypatch, capfd, "run", *link_options(tmp_path))
        assert status == 2
        assert "exists and is not a link" in err
        assert (tmp_path / "khepera").read_text() == "precious"

    def test_arenas_are_listed_with_their_titles(
        self, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
    ) -> None:
        status, out, _ = self.run(monkeypatch, capfd, "arenas")
        assert status == 0
        assert f"m  {load_arena('corridor').title}\n" in out

    def test_help_has_examples(
        self, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
    ) -> None:
        status, out, _ = self.run(monkeypatch, capfd, "run", "--help")
        assert status == 0
        assert "khepera-emulator run --link runs/khepera" in out


class TestClock:
    def test_runs_at_its_speed(self) -> None:
        real = [100.0]
        clock = Clock(4.0, lambda: real[0])
        assert clock.now == 0.0
        real[0] += 2.0
        assert clock.now == 8.0
        assert clock.delay(10.0) == 0.5
        assert clock.delay(7.0) == 0.0

    def test_stands_still_when_told(self) -> None:
        real = [100.0]
        clock = Clock(4.0, lambda: real[0])
        real[0] += 2.0
        clock.fall_back(3.0)
        assert clock.now == 5.0


@contextmanager
def in_thread(baud: int | None, clock: Clock) -> Iterator[tuple[PtyPort, Emulator]]:
    """A daemon in this process, to look into its robot afterwards."""
    emulated = Emulator(Setup(load_arena("corridor"), drift=PRESETS["none"], baud=baud))
    port = PtyPort()
    daemon = Daemon(emulated, clock)
    daemon.add(emulated, port, follow_rate=False)
    if baud:
        with serial.Serial(port.url, baud):
            pass  # as `stty` would: it is the same rate for all that follow
    thread = threading.Thread(target=daemon.run)
    thread.start()
    try:
        yield port, emulated
    finally:
        daemon.stop()
        thread.join(PATIENCE)
        port.close()
        emulated.close()


class TestLimits:
    def test_robot_stands_still_while_its_process_is_stopped(self) -> None:
        stopped = 0.0
        clock = Clock(source=lambda: time.monotonic() + stopped)
        with (
            in_thread(None, clock) as (port, _),
            serial.Serial(port.url, timeout=PATIENCE) as client,
        ):
            assert ask(client, b"D,1,1\n") == b"d\r\n"
            stopped = 3600.0
            assert max(counters(client)) < 1000  # an hour would be 360,000

    def test_client_that_writes_without_end_is_held_back_by_the_line(self) -> None:
        with in_thread(300, Clock()) as (port, emulated):
            terminal = os.open(port.url, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            with suppress(BlockingIOError):
                for _ in range(10_000):
                    os.write(terminal, b"\n" * 100)
                pytest.fail("a megabyte went into a line of 300 bits a second")
            assert emulated.uart.arriving() <= 256
            os.close(terminal)

    def test_client_that_never_reads_neither_stops_the_robot_nor_reaches_the_next(self) -> None:
        with emulator("--no-zenoh", "--baud", "unpaced", "--log-level", "info") as running:
            with connect(running, write_timeout=PATIENCE) as client:
                for _ in range(200):
                    client.write(b"B\n" * 100)  # each is answered with 13 bytes
            with connect(running) as client:
                assert ask(client, b"H\n") == b"h,0,0\r\n"
            _, said = running.end()
        dropped = int(said.partition(" bytes to clients that did not read")[0].split()[-1])
        assert 100_000 < dropped < 260_000

    def test_many_clients_that_leave_at_once_do_not_fill_the_memory(self) -> None:
        with in_thread(300, Clock()) as (port, emulated):
            for _ in range(50):
                terminal = os.open(port.url, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
                with suppress(BlockingIOError):
                    os.write(terminal, b"\n" * 4000)
                os.close(terminal)
            deadline = time.monotonic() + PATIENCE
            while emulated.uart.arriving() < 4000:
                assert time.monotonic() < deadline
            assert emulated.uart.arriving() < 10_000


class TestHangUp:
    def test_reply_does_not_reach_a_client_that_has_come_since(self) -> None:
        emulated = Emulator(Setup(load_arena("corridor"), baud=None))
        port = PtyPort()
        line = _Line(emulated, port, False, None, None)

        def look(ready: set[int]) -> None:
            line.look(ready)
            line.take(emulated.now)
            emulated.advance(emulated.now)

        with serial.Serial(port.url) as first:
            first.write(b"B\n")
            look(set())
        with serial.Serial(port.url, timeout=0.1) as second:
            line.hand_over()
            assert second.read(1) == b""
            look({max(port.descriptors(room=True)) + 1})  # only somebody else is ready
            assert emulated.uart.queued() == 0
            second.write(b"H\n")
            look(set())
            line.hand_over()
            assert second.read(7) == b"h,0,0\r\n"
        port.close()
        emulated.close()

    def test_no_half_request_of_one_client_is_left_to_the_next(self) -> None:
        emulated = Emulator(Setup(load_arena("corridor"), baud=None))
        port = PtyPort()
        line = _Line(emulated, port, False, None, None)
        with serial.Serial(port.url) as first:
            first.write(b"\n" + b"B\n" * 3000)  # more than may wait, and cut in a request
        with serial.Serial(port.url, timeout=PATIENCE) as second:
            second.write(b"H\n")
            line.look(set())
            assert line.take(emulated.now)
            assert line.lost > 0
            emulated.advance(emulated.now + 1.0)
            line.hand_over()
            assert second.read_until(b"\n") == b"h,0,0\r\n"
        port.close()
        emulated.close()

    @pytest.mark.parametrize("flood", [b"N\n" * 500_000, b"\n" * 10_000, b"D,1,1\r\n" * 1000])
    def test_what_a_flood_leaves_behind_keeps_the_next_for_five_seconds_at_most(
        self, monkeypatch: pytest.MonkeyPatch, flood: bytes
    ) -> None:
        monkeypatch.setattr(tcp, "GRACE", 0.0)
        emulated = Emulator(Setup(load_arena("corridor"), drift=PRESETS["none"], baud=9600))
        port = TcpPort("127.0.0.1:0")
        line = _Line(emulated, port, False, None, None)
        address = tcp_address(port.url.partition("//")[2])

        def live(until: Callable[..., Any]) -> None:
            while not until():
                line.descriptors()
                line.look(set())
                line.take(emulated.now)
                emulated.advance(emulated.now + 0.02)
                line.hand_over()

        def flood_and_leave() -> None:
            with socket.create_connection(address, PATIENCE) as first:
                first.sendall(flood)

        thread = threading.Thread(target=flood_and_leave)
        thread.start()
        live(lambda: port._client)
        live(lambda: port._ended or not port._client)
        thread.join(PATIENCE)
        with socket.create_connection(address, PATIENCE) as second:
            begun = emulated.now
            second.sendall(b"\nH\n")
            live(lambda: select.select((second,), (), (), 0)[0])
            # what is kept of the flood, and the next one's own request and reply
            assert emulated.now - begun < wire_time(4096 + 256 + 20, 9600) + 0.1
            live(lambda: emulated.uart.idle)
            assert second.makefile("rb").readline().startswith(b"h,")
        port.close()
        emulated.close()

    @pytest.mark.parametrize("baud", [None, 9600])
    def test_requests_are_carried_out_but_not_answered(self, baud: int | None) -> None:
        emulated = Emulator(Setup(load_arena("corridor"), baud=baud))
        emulated.write(b"G,7,8\nH\nX\n")
        emulated.advance(0.003)
        emulated.hang_up()
        emulated.write(b"H\n")
        emulated.advance(1.0)
        assert emulated.read() == b"h,7,8\r\n"
        emulated.close()
