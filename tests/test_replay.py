"""Wire logs: written by a daemon, read back, played to robots, and what counts as a difference."""

import json
import re
import sys
from importlib import resources
from pathlib import Path

import pytest
import serial
from emulator_process import PATIENCE, emulator
from in_process import open_robot

import khepera_emulator  # noqa: F401 - registers khepera://
from khepera_emulator.app.cli.program import run
from khepera_emulator.app.replay import Difference, replay
from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line import wire_log
from khepera_emulator.line.coding import LineFormat
from khepera_emulator.line.wire_log import Entry, Recording, WireLog, read_log
from khepera_emulator.robot.options import robot_url

URL = "khepera://corridor?seed=3"
SESSION = (b"B\n", b"D,5,3\n", b"N\n", b"N\nO\nH\n", b"D,0,0\n", b"K\n", b"M\n", b"memory\n")


def play(
    recording: Recording, url: str = URL, ignore: list[str] | tuple[()] = ()
) -> int | Difference:
    with open_robot(url, timeout=1) as port:
        return replay(recording, port, ignore)


def log_of(*lines: tuple[bytes, bytes], url: str = URL) -> Recording:
    """A log of replies to one request each, a second apart."""
    entries = []
    for second, (request, said) in enumerate(lines):
        entries.append(Entry(float(second), "request", request))
        if said:
            entries.append(Entry(second + 0.5, "reply", said))
    return Recording(url, tuple(entries))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of two clients at two rates, one of which leaves with replies under way."""
    path = tmp_path_factory.mktemp("log") / "wire.jsonl"
    # requests are bent, not replies: how many bytes come before the stray ones hangs on real time
    faults = ("flip:p=0.03,dir=request", "delay:p=0.02,time=0.01", "stray:at=0.1,text=tick\\n")
    options = [word for fault in faults for word in ("--fault", fault)]
    with emulator(
        "--no-zenoh", "--seed", "3", "--dead-man", "60", "--record", str(path), *options
    ) as running:
        for rate in (9600, 38400):
            with serial.Serial(running.path, rate, timeout=0.2) as port:
                for request in SESSION:
                    port.write(request)
                    port.read_until(b"\n")
                port.write(b"N\nN\n")
                port.read(5)
    return path


class TestRecording:
    def test_holds_both_directions_settings_goodbyes_and_faults(self, recorded: Path) -> None:
        log = read_log(recorded)
        assert log.url.startswith(
            "khepera://corridor?fault=flip%3Ap%3D0.03%2Cdir%3Drequest&fault=delay"
        )
        assert log.url.endswith("&dead-man=60.0")
        assert b"".join(each.data for each in log.entries if each.what == "request") == (
            b"".join((*SESSION, b"N\nN\n")) * 2
        )
        said = b"".join(each.data for each in log.entries if each.what == "reply")
        assert said.count(b"n,") >= 3
        assert b"tick\n" in said
        lines = [each.line for each in log.entries if each.what == "line"]
        assert lines == [LineFormat(9600), LineFormat(38400)]
        assert [each.what for each in log.entries].count("close") == 2
        faults = [json.loads(line) for line in recorded.read_text().splitlines() if "flip" in line]
        assert faults[1]["what"] == "fault"
        assert faults[1]["direction"] in ("request", "reply")
        times = [each.time for each in log.entries]
        assert times == sorted(times)

    def test_played_in_virtual_time_gives_the_same_bytes(self, recorded: Path) -> None:
        log = read_log(recorded)
        result = play(log, log.url)
        assert isinstance(result, int), str(result)
        assert result > 12

    def test_of_a_line_that_takes_no_time_gives_the_same_bytes(self, tmp_path: Path) -> None:
        path = tmp_path / "wire.jsonl"
        options = ("--baud", "unpaced", "--speed", "20")
        with emulator("--no-zenoh", "--seed", "3", "--record", str(path), *options) as running:
            for _ in range(2):
                with serial.Serial(running.path, timeout=PATIENCE) as port:
                    # while it moves every millisecond counts
                    for request in (b"D,9,7\n", b"H\nE\n", b"C,50,90\n", b"K\nN\n") * 8:
                        port.write(request)
                        for _ in range(request.count(b"\n")):
                            port.read_until(b"\n")
                    port.write(b"H\nN\n")  # and leave
        log = read_log(path)
        result = play(log, log.url)
        assert isinstance(result, int), str(result)
        assert result >= 2 * 8 * 6
        times = [each.time for each in log.entries]
        assert times == sorted(times)

    def test_of_another_robot_differs(self, recorded: Path) -> None:
        log = read_log(recorded)
        result = play(log, log.url.replace("seed=3", "seed=4"))
        assert isinstance(result, Difference)

    def test_keeps_every_byte(self, tmp_path: Path) -> None:
        every_byte = bytes(range(256))
        with WireLog(tmp_path / "log", URL) as log:
            log.request(0.1, every_byte)
            log.line(0.2, LineFormat(9600, 7, "E", 1.5))
            log.line(0.3, LineFormat(9600, 7, "E", 1.5))
            log.line(0.3, None)
            log.reply(1 / 3, every_byte)
            log.close(1.0)
        assert read_log(tmp_path / "log") == Recording(
            URL,
            (
                Entry(0.1, "request", every_byte),
                Entry(0.2, "line", line=LineFormat(9600, 7, "E", 1.5)),
                Entry(1 / 3, "reply", every_byte),
                Entry(1.0, "close"),
            ),
        )

    def test_may_end_in_the_middle_of_a_line_and_hold_news(self, tmp_path: Path) -> None:
        with WireLog(tmp_path / "log", URL) as log:
            log.request(0.0, b"B\n")
        with (tmp_path / "log").open("a") as file:
            file.write('{"t": 1.0, "what": "battery", "volts": 4.8}\n{"t": 2.0, "wha')
        assert [each.what for each in read_log(tmp_path / "log").entries] == ["request", "battery"]

    @pytest.mark.parametrize(
        ("text", "why"),
        [
            ("", "line 1 of .* is no JSON object"),
            ("hello\n", "line 1 of .* is no JSON object"),
            ("[1]\n", "line 1 of .* is no JSON object"),
            ("{}\n", "its first line names no khepera-wire-log"),
            ('{"format": "khepera-wire-log", "version": 2}\n', "this program reads version 1"),
            ('{"format": "khepera-wire-log", "version": 1, "url": 3}\n', "its url is no text"),
            ("ä", "line 1 of .* is no JSON object"),
            ("[" * 99_000 + "\n", "line 1 of .* is no JSON object"),
            ("\0" * 200_000, "line 1 of .* is no JSON object"),
        ],
    )
    def test_that_is_none_is_refused(self, tmp_path: Path, text: str, why: str) -> None:
        (tmp_path / "log").write_text(text)
        with pytest.raises(EmulatorError, match=why):
            read_log(tmp_path / "log")

    @pytest.mark.parametrize(
        ("line", "why"),
        [
            ("", "is no JSON object"),
            ("{}", "is no entry of a wire log: 2 mistakes: the key 't' is missing"),
            ('{"t": 1}', "is no entry of a wire log: the key 'what' is missing"),
            ('{"t": "1", "what": "close"}', "t: '1' is not a number"),
            ('{"t": true, "what": "close"}', "t: True is not a number"),
            ('{"t": NaN, "what": "close"}', "is no JSON object"),
            ('{"t": 1e999, "what": "close"}', "is no"),
            ('{"t": -1, "what": "close"}', "t: -1 is less than 0"),
            ('{"t": 1e10, "what": "close"}', r"t: 10000000000.0 is more than 1e\+09"),
            ('{"t": 9e8, "what": "close"}', r"comes after 9e\+08 s of silence"),
            ('{"t": ' + "9" * 5000 + ', "what": "close"}', "is no"),
            ('{"t": 1, "what": ["close"]}', "what: .* is not a text"),
            ('{"t": 1, "what": "reply"}', "the key 'data' is missing"),
            ('{"t": 1, "what": "reply", "data": "\\u0100"}', "no byte"),
            ('{"t": 1, "what": "reply", "data": "\\ud800"}', "is no JSON object"),
            ('{"t": 1, "what": "line", "baud": 9600}', "3 mistakes: the key 'bits' is missing"),
            (
                '{"t": 1, "what": "line", "baud": 0, "bits": 9, "parity": "X", "stop": 7}',
                "4 mistakes: baud: 0 is less than 1; bits: 9 is more than 8; parity: 'X' is not",
            ),
            ('{"a": ' * 10_000, "is no JSON object"),
            ('{"t": 1, "what": "reply", "data": "' + "x" * 100_000 + '"}', "is too long"),
        ],
    )
    def test_that_is_damaged_is_read_up_to_the_damage(
        self, tmp_path: Path, line: str, why: str
    ) -> None:
        with WireLog(tmp_path / "log", URL) as log:
            log.request(0.5, b"B\n")
        with (tmp_path / "log").open("a") as file:
            file.write(line + '\n{"t": 2.0, "what": "close"}\n')
        kept = read_log(tmp_path / "log")
        assert kept.entries == (Entry(0.5, "request", b"B\n"),)
        assert re.match(f"line 3 of .* {why}", kept.damage), kept.damage
        assert kept.damage.isprintable()

    def test_that_never_ends_is_read_as_far_as_there_is_memory(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(wire_log, "_MOST_ENTRIES", 3)
        with WireLog(tmp_path / "log", URL) as log:
            for moment in range(5):
                log.request(float(moment), b"B\n")
        kept = read_log(tmp_path / "log")
        assert len(kept.entries) == 2
        assert "is longer than 3 lines" in kept.damage

    def test_that_is_not_there_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(EmulatorError, match="cannot read the wire log"):
            read_log(tmp_path / "log")
        for path, why in (("/", "Is a dir"), (".", "Is a dir"), ("a" * 300, "too long")):
            with pytest.raises(EmulatorError, match=f"cannot read the wire log .*{why}"):
                read_log(Path(path))
        with pytest.raises(EmulatorError, match="cannot record to"):
            WireLog(tmp_path, URL)

    def test_names_a_robot_that_can_be_opened(self) -> None:
        url = robot_url(
            "corridor", [("model", "khepera2"), ("fault", "stray:p=1,text=&#%"), ("x", "")]
        )
        assert url == "khepera://corridor?model=khepera2&fault=stray%3Ap%3D1%2Ctext%3D%26%23%25"
        with open_robot(url, timeout=1) as port:
            port.write(b"B\n")
            assert port.readline() == b"&#%b,5.02,5.01\r\n"

    @pytest.mark.parametrize("name", ["a#b", "a?b=1&c", "100%", "%41", "a b", "ä", "a;b", "[x"])
    def test_names_an_arena_by_its_path_whatever_is_in_it(self, tmp_path: Path, name: str) -> None:
        arena = tmp_path / f"{name}.toml"
        arena.write_text(f"{MAZE}")
        url = robot_url(str(arena), [("seed", "3")])
        with open_robot(url, timeout=1) as port:
            assert port.emulator.setup.arena.title == load_arena("maze").title
            assert port.emulator.setup.seed == 3


MAZE = (resources.files("khepera_emulator") / "arenas" / "maze.toml").read_text("utf-8")
VERSION = b"b,5.01,5.00\r\n"


class TestReplay:
    def test_counts_equal_lines(self) -> None:
        assert play(log_of((b"B\n", VERSION), (b"H\nX\n", b"h,0,0\r\nCommand not found\r\n"))) == 3

    @pytest.mark.parametrize(
        ("logged", "said"),
        [
            (b"b,5.02,5.00\r\n", VERSION),
            (b"b,5.01,5.00\n", VERSION),
            (b"b,5.01,5.00\r\nmore\r\n", b""),
            (b"\xff" + VERSION, VERSION),
            (b"b,5.01,5.01", VERSION),
        ],
    )
    def test_tells_the_first_difference(self, logged: bytes, said: bytes) -> None:
        result = play(log_of((b"H\n", b"h,0,0\r\n"), (b"B\n", logged), (b"B\n", b"x\r\n")))
        assert isinstance(result, Difference)
        expected = said or (VERSION if logged.endswith(b"more\r\n") else b"")
        assert (result.request, result.said) == (b"B\n", expected)
        assert result.time in (1.5, 2.5)

    def test_tells_that_nothing_came(self) -> None:
        result = play(log_of((b"B", VERSION)))
        assert result == Difference(0.5, b"B", VERSION, b"")
        assert str(result) == (
            "difference at 0.500 s, after the request b'B'\n"
            "  log:   b'b,5.01,5.00\\r\\n'\n"
            "  robot: b'' (nothing came)"
        )

    def test_takes_the_beginning_of_a_line_at_the_end_of_a_log(self) -> None:
        assert play(log_of((b"B\n", b"b,5.0"))) == 1
        assert play(log_of((b"B\n", b""))) == 0

    @pytest.mark.parametrize(
        ("ignore", "logged", "equal"),
        [
            ("H", b"h,7,8\r\n", True),
            ("h", b"h,7,8\r\n", True),
            ("N", b"h,7,8\r\n", False),
            ("H", b"h,7\r\n", False),
            ("H", b"hello,7,8\r\n", False),
        ],
    )
    def test_may_ignore_values(self, ignore: str, logged: bytes, equal: bool) -> None:
        result = play(log_of((b"H\n", logged)), ignore=[ignore])
        assert isinstance(result, int) == equal

    def test_sets_the_rate_and_writes_at_the_times(self) -> None:
        entries = (
            Entry(0.0, "line", line=LineFormat(38400)),
            Entry(2.5, "request", b"B\n"),
            Entry(3.0, "reply", VERSION),
        )
        with open_robot(URL, timeout=1) as port:
            assert replay(Recording(URL, entries), port) == 1
            assert port.baudrate == 38400
            assert port.now == pytest.approx(3.0)

    def test_plays_to_any_port(self) -> None:
        begin = log_of((b"B\n", VERSION), (b"G,1,2\n", b"g\r\n"), (b"H\n", b"h,1,2\r\n"))
        quick = [Entry(each.time / 100, each.what, each.data) for each in begin.entries]
        wrong = Entry(0.06, "reply", b"h,3,4\r\n")
        with (
            emulator("--no-zenoh", "--tcp", "127.0.0.1:0", "--baud", "unpaced") as running,
            serial.serial_for_url(running.path, timeout=PATIENCE) as port,
        ):
            twice = (*quick, Entry(0.05, "close"), *quick)
            assert replay(Recording(URL, twice), port) == 6
            result = replay(Recording(URL, (*quick, Entry(0.05, "request", b"H\n"), wrong)), port)
            assert result == Difference(0.06, b"H\n", wrong.data, b"h,1,2\r\n")


class TestCommand:
    @staticmethod
    def run(
        monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], *arguments: Path | str
    ) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["khepera-emulator", "replay", *map(str, arguments)])
        status = run()
        out, err = capfd.readouterr()
        return status, out, err

    @pytest.fixture
    def file(self, tmp_path: Path) -> Path:
        path = tmp_path / "wire.jsonl"
        with WireLog(path, URL) as log:
            log.request(0.0, b"H\n")
            log.reply(0.5, b"h,7,8\r\n")
        return path

    def test_ends_with_one_and_the_difference(
        self, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], file: Path
    ) -> None:
        status, out, _ = self.run(monkeypatch, capfd, file)
        assert status == 1
        assert out.startswith("difference at 0.500 s, after the request b'H\\n'\n")

    def test_leaves_a_standing_robot(
        self, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        path = tmp_path / "wire.jsonl"
        with WireLog(path, URL) as log:
            log.request(0.0, b"D,5,5\n")
            log.reply(0.01, b"d\r\n")
        with emulator("--no-zenoh", "--baud", "unpaced") as running:
            assert self.run(monkeypatch, capfd, path, "--port", running.path)[0] == 0
            with serial.Serial(running.path, timeout=PATIENCE) as port:
                speeds = b""
                while speeds != b"e,0,0\r\n":  # it rolls on a little
                    port.write(b"E\n")
                    speeds = port.read_until(b"\n")

    def test_ends_with_zero_when_equal(
        self, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], file: Path
    ) -> None:
        status, out, _ = self.run(monkeypatch, capfd, file, "--ignore", "N,H")
        assert (status, out) == (0, "1 reply lines equal\n")

    def test_plays_what_stands_before_the_damage_and_says_so(
        self, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        path = tmp_path / "wire.jsonl"
        with WireLog(path, URL) as log:
            log.request(0.0, b"B\n")
            log.reply(0.5, VERSION)
        with path.open("a") as file:
            file.write('{"t": 1.0, "what": "requ\n{"t": 2.0, "what": "close"}\n')
        status, out, err = self.run(monkeypatch, capfd, path)
        assert (status, out) == (2, "1 reply lines equal\n")
        assert err == (
            f"khepera-emulator: line 4 of {path} is no JSON object: no wire log; only what stands"
            " before was replayed\n"
        )

    @pytest.mark.parametrize(
        "url",
        [
            "",
            "{folder}/khepera",
            "loop://",
            "spy://khepera://corridor?file={folder}/precious",
            "spy://loop://?file={folder}/precious",
            "alt://khepera?class=PosixPollSerial",
            "socket://127.0.0.1:1",
            "KHEPERA://corridor",
            " khepera://corridor",
            "khepera.ports.protocol_khepera://corridor",
            "khepera://corridor?file={folder}/precious",
            "khepera://corridor?record={folder}/precious&link={folder}/precious",
            "khepera://corridor\x1b[2J",
            "khepera://corridor?\x1b[2J=1",
        ],
    )
    def test_opens_nothing_but_emulated_robots_that_a_log_names(
        self,
        monkeypatch: pytest.MonkeyPatch,
        capfd: pytest.CaptureFixture[str],
        tmp_path: Path,
        url: str,
    ) -> None:
        precious = tmp_path / "precious"
        precious.write_text("precious")
        path = tmp_path / "wire.jsonl"
        with WireLog(path, url.format(folder=tmp_path)) as log:
            log.request(0.0, b"B\n")
        status, out, err = self.run(monkeypatch, capfd, path)
        assert (status, out) == (2, "")
        assert err.count("\n") == 1
        assert err[:-1].isprintable()
        assert precious.read_text() == "precious"
        assert sorted(each.name for each in tmp_path.iterdir()) == ["precious", "wire.jsonl"]

    def test_plays_a_run_in_an_arena_with_a_name_of_any_kind(
        self, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        arena, log = tmp_path / "my #1?arena=100%.toml", tmp_path / "wire.jsonl"
        arena.write_text(MAZE)
        with (
            emulator("--no-zenoh", "--arena", str(arena), "--record", str(log)) as running,
            serial.Serial(running.path, timeout=PATIENCE) as port,
        ):
            port.write(b"B\n")
            assert port.readline() == VERSION
        status, out, err = self.run(monkeypatch, capfd, log)
        assert (status, out) == (0, "1 reply lines equal\n"), err

    def test_plays_a_log_with_a_strangers_url_to_a_port_of_ones_own(
        self, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        path = tmp_path / "wire.jsonl"
        with WireLog(path, "spy://loop://?file=/tmp/x") as log:
            log.request(0.0, b"B\n")
            log.reply(0.5, VERSION)
        assert self.run(monkeypatch, capfd, path, "--port", URL)[0] == 0

    @pytest.mark.parametrize("url", ["/nowhere", "khepera://nowhere", "what://is"])
    def test_port_that_is_none_is_one_sentence(
        self,
        monkeypatch: pytest.MonkeyPatch,
        capfd: pytest.CaptureFixture[str],
        file: Path,
        url: str,
    ) -> None:
        status, out, err = self.run(monkeypatch, capfd, file, "--port", url)
        assert (status, out) == (2, "")
        assert err.startswith(f"khepera-emulator: cannot replay on {url}: ")
        assert err.count("\n") == 1
