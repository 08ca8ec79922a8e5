"""`khepera-emulator run --robots N`: a terminal, a link and Zenoh keys for each robot."""

import subprocess
from math import hypot

import pytest
import serial
from emulator_process import COMMAND, PATIENCE, emulator, free_endpoint
from test_side_channel import session, truth_of, wait_for

from khepera_emulator.cli import main


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    """Three robots in an open box: paths of their links, and their Zenoh endpoint."""
    folder, endpoint = tmp_path_factory.mktemp("robots"), free_endpoint()
    options = ("--arena", "open-box", "--robots", "3", "--robot", "kheep", "--drift", "none")
    with emulator(*options, "--link", str(folder / "line"), "--listen", endpoint) as started:
        lines = [started.announcement, *(started.process.stdout.readline() for _ in range(2))]
        yield folder, endpoint, [line.rstrip("\n") for line in lines]


def ask(port, request):
    port.write(request)
    return port.read_until(b"\n")


def test_each_is_announced_with_its_own_link(running):
    folder, _, lines = running
    for number, line in enumerate(lines, 1):
        link = folder / f"line-{number}"
        assert line == f"kheep-{number} on {link.readlink()}, link {link}"
    assert len({line.split()[2] for line in lines}) == 3


def test_each_line_drives_its_own_robot(running):
    folder, endpoint, _ = running
    with session(connect=[endpoint]) as peer:
        for number in (1, 2, 3):
            wait_for(peer, f"khepera/kheep-{number}/alive")

        def truth(number):
            (reply,) = peer.get(f"khepera/kheep-{number}/truth", timeout=PATIENCE)
            return truth_of(reply.ok)

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


def test_each_has_a_camera_and_a_reset(running):
    _, endpoint, _ = running
    with session(connect=[endpoint]) as peer:
        wait_for(peer, "khepera/kheep-2/alive")
        (picture,) = peer.get("khepera/kheep-2/camera", timeout=PATIENCE)
        assert picture.ok.payload.to_bytes().startswith(b"\x89PNG")
        place = '{"pose": {"x": 0.4, "y": 0.4, "heading": 0}}'
        (reply,) = peer.get("khepera/kheep-2/reset", payload=place, timeout=PATIENCE)
        assert truth_of(reply.ok).pose.x == 0.4
        (reply,) = peer.get("khepera/kheep-1/reset", payload=place, timeout=PATIENCE)
        assert "no room for the robot" in reply.err.payload.to_string()


def test_links_go_at_the_end(tmp_path):
    with emulator("--robots", "2", "--no-zenoh", "--link", str(tmp_path / "line")) as started:
        started.process.stdout.readline()
        assert {path.name for path in tmp_path.iterdir()} >= {"line-1", "line-2"}
        assert started.end() == (0, "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--tcp", "127.0.0.1:0"), "are for one robot"),
        (("--record", "log"), "are for one robot"),
        (
            ("--link", "line", "--arena", "narrow-passage", "--robots", "32"),
            "no free place for a robot",
        ),
    ],
)
def test_what_cannot_be_is_told_in_one_sentence(monkeypatch, capfd, tmp_path, options, words):
    monkeypatch.chdir(tmp_path)
    arguments = ["run", "--no-zenoh", "--robots", "2", *options]
    monkeypatch.setattr("sys.argv", ["khepera-emulator", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capfd.readouterr().err
    assert ended.value.code == 2
    assert words in said
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_one_robot_keeps_its_name(tmp_path):
    with emulator("--no-zenoh", "--robots", "1", "--link", str(tmp_path / "line")) as started:
        assert started.announcement.startswith("khepera on /dev/pts/")
        assert started.announcement.endswith(f"link {tmp_path / 'line'}")


def test_so_many_robots_are_too_many():
    done = subprocess.run(
        [*COMMAND, "--robots", "33"], capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 2
    assert "--robots" in done.stderr
