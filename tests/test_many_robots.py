"""`khepera-emulator run --robots N`: a terminal, a link and Zenoh keys for each robot."""

import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from math import hypot
from pathlib import Path

import pytest
import serial
from as_type import not_none
from emulator_process import COMMAND, PATIENCE, emulator, free_endpoint
from in_process import open_robot
from khepera_protocol.zenoh.payloads import Truth
from test_side_channel import session, truth_of, wait_for

import khepera_emulator  # noqa: F401 - registers khepera://
from khepera_emulator.app.cli.program import run
from khepera_emulator.app.replay import replay
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.wire_log import read_log
from khepera_emulator.ports.tcp import shifted


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, str, list[str]]]:
    """Three robots in an open box: paths of their links, and their Zenoh endpoint."""
    folder, endpoint = tmp_path_factory.mktemp("robots"), free_endpoint()
    options = ("--arena", "open-box", "--robots", "3", "--robot", "kheep", "--drift", "none")
    with emulator(*options, "--link", str(folder / "line"), "--listen", endpoint) as started:
        lines = [
            started.announcement,
            *(not_none(started.process.stdout).readline() for _ in range(2)),
        ]
        yield folder, endpoint, [line.rstrip("\n") for line in lines]


def ask(port: serial.SerialBase, request: bytes) -> bytes:
    port.write(request)
    return port.read_until(b"\n")


def test_each_is_announced_with_its_own_link(running: tuple[Path, str, list[str]]) -> None:
    folder, _, lines = running
    for number, line in enumerate(lines, 1):
        link = folder / f"line-{number}"
        assert line == f"kheep-{number} on {link.readlink()}, link {link}"
    assert len({line.split()[2] for line in lines}) == 3


def test_each_line_drives_its_own_robot(running: tuple[Path, str, list[str]]) -> None:
    folder, endpoint, _ = running
    with session(connect=[endpoint]) as peer:
        for number in (1, 2, 3):
            wait_for(peer, f"khepera/kheep-{number}/alive")

        def truth(number: int) -> Truth:
            (reply,) = peer.get(f"khepera/kheep-{number}/truth", timeout=PATIENCE)
            return truth_of(not_none(reply.ok))

        before = [truth(number) for number in (1, 2, 3)]
        with (
            serial.Serial(str(folder / "line-1"), timeout=PATIENCE) as first,
            serial.Serial(str(folder / "line-3"), timeout=PATIENCE) as third,
        ):
            assert ask(first, b"G,100,200\n") == b"g\r\n"
            assert ask(third, b"D,2,-2\n") == b"d\r\n"
            while ask(third, b"H\n").split(b",")[1] in (b"0", b"1"):
                pass
            assert ask(first, b"H\n") == b"h,100,200\r\n"
            assert ask(third, b"D,0,0\n") == b"d\r\n"
        after = [truth(number) for number in (1, 2, 3)]
    assert [a.pose == b.pose for a, b in zip(after, before, strict=True)] == [True, True, False]
    places = [(each.pose.x, each.pose.y) for each in before]
    assert min(hypot(places[0][0] - x, places[0][1] - y) for x, y in places[1:]) > 0.08


def test_each_has_a_camera_and_a_reset(running: tuple[Path, str, list[str]]) -> None:
    _, endpoint, _ = running
    with session(connect=[endpoint]) as peer:
        wait_for(peer, "khepera/kheep-2/alive")
        (picture,) = peer.get("khepera/kheep-2/camera", timeout=PATIENCE)
        assert not_none(picture.ok).payload.to_bytes().startswith(b"\x89PNG")
        place = '{"pose": {"x": 0.4, "y": 0.4, "heading": 0}}'
        (reply,) = peer.get("khepera/kheep-2/reset", payload=place, timeout=PATIENCE)
        assert truth_of(not_none(reply.ok)).pose.x == 0.4
        (reply,) = peer.get("khepera/kheep-1/reset", payload=place, timeout=PATIENCE)
        assert "no room for the robot" in not_none(reply.err).payload.to_string()


@pytest.mark.parametrize("scheme", ["socket", "rfc2217"])
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_each_has_a_port_and_a_log_of_its_own(tmp_path: Path, scheme: str) -> None:
    option = {"socket": "--tcp", "rfc2217": "--rfc2217"}[scheme]
    options = ("--arena", "open-box", "--robots", "2", "--seed", "3", option, "127.0.0.1:0")
    with emulator("--no-zenoh", *options, "--record", str(tmp_path / "wire.jsonl")) as started:
        urls = [started.path, not_none(started.process.stdout).readline().split()[2]]
        assert [url.partition(":")[0] for url in urls] == [scheme] * 2
        with ExitStack() as stack:
            first, second = (
                stack.enter_context(serial.serial_for_url(url, timeout=PATIENCE)) for url in urls
            )
            assert ask(first, b"G,1,1\n") == b"g\r\n"
            assert ask(second, b"D,3,-3\n") == b"d\r\n"
            assert ask(first, b"H\n") == b"h,1,1\r\n"
            assert ask(second, b"N\n").startswith(b"n,")
            assert ask(second, b"H\n").startswith(b"h,")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["wire-1.jsonl", "wire-2.jsonl"]
    for number, lines in ((1, 2), (2, 3)):
        log = read_log(tmp_path / f"wire-{number}.jsonl")
        assert log.url.endswith(f"&robots=2&robot={number}")
        with serial.serial_for_url(log.url, timeout=1) as port:
            assert replay(log, port) == lines


def test_ports_follow_each_other() -> None:
    assert shifted("127.0.0.1:4000", 2) == "127.0.0.1:4002"
    assert shifted("[::1]:4000", 1) == "[::1]:4001"
    assert shifted("localhost:0", 5) == "localhost:0"
    with pytest.raises(EmulatorError, match="no address"):
        shifted("4000", 1)


def test_one_of_several_fits_into_a_url() -> None:
    places = []
    for robot in (1, 2):
        url = f"khepera://open-box?robots=2&robot={robot}&seed=3"
        with open_robot(url, timeout=1) as port:
            assert ask(port, b"G,5,6\n") == b"g\r\n"
            places.append(port.emulator.truth().pose)
    assert hypot(places[0].x - places[1].x, places[0].y - places[1].y) > 0.05
    for options, words in (
        ("robots=33", "robots should be less than or equal to 32"),
        ("robot=2", "not from 1 to 1"),
    ):
        with pytest.raises(serial.SerialException, match=words):
            open_robot(f"khepera://open-box?{options}")


def test_links_go_at_the_end(tmp_path: Path) -> None:
    with emulator("--robots", "2", "--no-zenoh", "--link", str(tmp_path / "line")) as started:
        not_none(started.process.stdout).readline()
        assert {path.name for path in tmp_path.iterdir()} >= {"line-1", "line-2"}
        assert started.end() == (0, "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--tcp", "127.0.0.1:65535"), "there are no ports for 2 robots from there on"),
        (
            ("--link", "line", "--arena", "narrow-passage", "--robots", "32"),
            "no free place for a robot",
        ),
    ],
)
def test_what_cannot_be_is_told_in_one_sentence(
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    tmp_path: Path,
    options: tuple[str, ...],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = ["run", "--no-zenoh", "--robots", "2", *options]
    monkeypatch.setattr("sys.argv", ["khepera-emulator", *arguments])
    status = run()
    said = capfd.readouterr().err
    assert status == 2
    assert words in said
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_one_robot_keeps_its_name(tmp_path: Path) -> None:
    with emulator("--no-zenoh", "--robots", "1", "--link", str(tmp_path / "line")) as started:
        assert started.announcement.startswith("khepera on /dev/pts/")
        assert started.announcement.endswith(f"link {tmp_path / 'line'}")


def test_so_many_robots_are_too_many() -> None:
    done = subprocess.run(
        [*COMMAND, "--robots", "33"], capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 2
    assert "--robots" in done.stderr
