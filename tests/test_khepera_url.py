"""khepera:// URLs: a robot behind pySerial's interface, the same for the same seed, always."""

import hashlib
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serial
from drives import Drive
from in_process import open_robot
from khepera_protocol.zenoh.payloads import Pose, Reset
from rig import Closing

import khepera_emulator  # noqa: F401 - registers the URL scheme
from khepera_emulator.errors import EmulatorError
from khepera_emulator.ports.protocol_khepera import Serial

BYTE = 11 / 9600


def open_port(url: str = "khepera://corridor?seed=1", **options: Any) -> Serial:
    return open_robot(url, **{"timeout": 1.0, **options})


@pytest.fixture
def port() -> Iterator[Serial]:
    with open_port() as opened:
        yield opened


def ask(port: Serial, line: bytes) -> bytes:
    port.write(line + b"\n")
    return port.readline()


def session(port: Serial, reset: Reset | None = None) -> list[object]:
    """Observations of a program: bytes, times, pictures and poses, from the first reset on."""
    emulator = port.emulator
    if reset is not None:
        emulator.reset(reset)
    begin = port.now
    seen: list[object] = []
    port.timeout = 0.0137
    for step in range(40):
        line = [b"D,%d,%d" % (step % 9 + 2, 8 - step % 5), b"N", b"H", b"O", b"K", b"E"][step % 6]
        port.write(line + b"\n")
        seen += [port.read(100), port.now - begin]
        if step % 10 == 3:
            seen.append(hashlib.sha256(emulator.mirror_image().tobytes()).hexdigest())
        if step == 20:
            seen.append(ask(port, b"C,300,-300"))
        truth = emulator.truth()
        seen += [truth.pose, truth.speed, truth.contact, truth.drift]
    seen.append(emulator.reset(Reset(random=True)).pose)
    return seen


def test_one_exchange(port: Serial) -> None:
    assert ask(port, b"B") == b"b,5.01,5.00\r\n"
    # two bytes there, 13 back, and the interpreter in between
    assert port.now == pytest.approx(15 * BYTE + 0.0015, abs=1e-7)


def test_nothing_is_said_unasked(port: Serial) -> None:
    assert port.read(10) == b""
    assert port.now == pytest.approx(1.0)


def test_the_rate_is_the_clients(port: Serial) -> None:
    port.baudrate = 38400
    ask(port, b"B")
    assert port.now == pytest.approx(15 * 11 / 38400 + 0.0015, abs=1e-7)


def test_a_fixed_rate_is_the_robots() -> None:
    with open_port("khepera://corridor?baud=19200", baudrate=19200) as port:
        ask(port, b"B")
        assert port.now == pytest.approx(15 * 11 / 19200 + 0.0015, abs=1e-7)
        assert ask(port, b"G,7,8") == b"g\r\n"
        port.baudrate = 9600
        port.write(b"G,1,2\n")
        port.read(100)
        port.baudrate = 19200
        ask(port, b"")
        port.write(b"B\n")
        port.baudrate = 38400
        assert port.readline() not in (b"", b"b,5.01,5.00\r\n")
        port.baudrate = 19200
        assert ask(port, b"H") == b"h,7,8\r\n"
        port.parity = "E"
        assert ask(port, b"B") != b"b,5.01,5.00\r\n"


def test_faults_are_taken_from_the_url() -> None:
    url = "khepera://corridor?fault=drop:p=1,n=1,dir=reply&fault=stray:at=2,text=tick%0A&seed=3"
    with open_port(url) as port:
        assert ask(port, b"B") == b",5.01,5.00\r\n"
        assert ask(port, b"B") == b"b,5.01,5.00\r\n"
        port.timeout = None
        assert port.readline() == b"tick\n"
        assert port.now == pytest.approx(2 + 5 * BYTE, abs=1e-7)
        with pytest.raises(serial.SerialException, match="nothing is on its way"):
            port.readline()


def test_a_robot_with_a_dead_man_stop_rolls_no_further() -> None:
    with open_port("khepera://corridor?dead-man=0.5") as port:
        ask(port, b"D,5,5")
        port.timeout = 2.0
        port.read(1)
        assert ask(port, b"H") == ask(port, b"H")


def test_a_robot_that_resets_forgets_and_says_its_banner() -> None:
    with open_port("khepera://corridor?fault=reset:at=1.5") as port:
        assert ask(port, b"D,5,5") == b"d\r\n"
        assert ask(port, b"G,100,100") == b"g\r\n"
        port.timeout = 2
        banner = port.readline() + port.readline()
        assert banner.startswith(b"ROM of minirobot KHEPERA")
        assert ask(port, b"H") == b"h,0,0\r\n"


def test_faults_are_the_same_for_the_same_seed() -> None:
    def replies(seed: int) -> list[bytes]:
        with open_port(
            f"khepera://corridor?seed={seed}&fault=flip:p=0.02&fault=drop:p=0.02"
        ) as port:
            port.timeout = 0.1
            return [ask(port, b"B") for _ in range(40)]

    assert replies(1) == replies(1)
    assert replies(1) != replies(2)


def test_a_seeded_reset_begins_faults_anew() -> None:
    with open_port("khepera://corridor?fault=drop:p=0.05&fault=stray:at=0.1,text=tick%0A") as port:
        port.timeout = 0.1
        seen = []
        for _ in range(2):
            port.emulator.reset(Reset(seed=4))
            seen.append([ask(port, b"B") for _ in range(20)])
        assert seen[0] == seen[1]
        assert b"tick\n" in seen[0]


def test_bytes_take_no_time_on_an_unpaced_line_and_writes_a_millisecond() -> None:
    with open_port("khepera://corridor?baud=unpaced") as port:
        for _ in range(100):
            assert ask(port, b"B") == b"b,5.01,5.00\r\n"
        assert port.now == pytest.approx(0.1, abs=1e-6)


def test_a_program_that_asks_until_it_is_there_gets_there_on_an_unpaced_line() -> None:
    with open_port("khepera://open-box?baud=unpaced&drift=none") as port:
        assert ask(port, b"C,500,500") == b"c\r\n"
        while not ask(port, b"K").startswith(b"k,1,"):
            assert port.now < 60.0
        assert abs(int(ask(port, b"H").split(b",")[1]) - 500) <= 5


READERS = {
    "readline": lambda port: port.readline(),
    "read_until": lambda port: port.read_until(b"\r\n"),
    "byte by byte": lambda port: b"".join(iter(lambda: port.read(1), b"\n")) + b"\n",
    "exactly": lambda port: port.read(13),
}


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_every_way_of_reading_takes_the_same_time(port: Serial, read: Callable[..., Any]) -> None:
    port.write(b"B\n")
    assert read(port) == b"b,5.01,5.00\r\n"
    assert port.now == pytest.approx(15 * BYTE + 0.0015, abs=1e-7)


def test_polling_without_a_timeout_gets_there(port: Serial) -> None:
    port.timeout = 0
    port.write(b"B\n")
    data = b""
    while not data.endswith(b"\n"):
        data += port.read(64)
    assert data == b"b,5.01,5.00\r\n"
    port.write(b"B\n")
    while not port.in_waiting:
        assert port.now < 1.0
    assert port.read(port.in_waiting) == b"b"


def test_two_requests_read_one_by_one(port: Serial) -> None:
    port.write(b"B\r\nH\r\n")
    assert port.readline() == b"b,5.01,5.00\r\n"
    between = port.now
    assert between < 30 * BYTE
    assert port.readline() == b"h,0,0\r\n"
    assert port.now == pytest.approx(between + 7 * BYTE, abs=1e-6)


def test_a_timeout_cuts_a_reply(port: Serial) -> None:
    port.write(b"B\n")
    port.timeout = 4.5 * BYTE + 0.0015
    assert port.readline() == b"b,"
    port.timeout = 1
    assert port.readline() == b"5.01,5.00\r\n"


def test_reading_at_most(port: Serial) -> None:
    port.write(b"B\n")
    assert port.readline(4) == b"b,5."
    assert port.read_until(b",", 100) == b"01,"
    assert port.read_until(b"x", 3) == b"5.0"
    assert port.read(0) == b""
    assert port.read(100) == b"0\r\n"


def test_waiting_for_ever_for_nothing_is_refused(port: Serial) -> None:
    port.timeout = None
    port.write(b"B\n")
    assert port.readline() == b"b,5.01,5.00\r\n"
    with pytest.raises(serial.SerialException, match="nothing is on its way"):
        port.read(1)
    port.write(b"B")
    with pytest.raises(serial.SerialException, match="nothing is on its way"):
        port.readline()


def test_flush_lets_the_request_arrive(port: Serial) -> None:
    port.write(b"D,5,5\n")
    port.flush()
    assert port.now == pytest.approx(6 * BYTE, abs=1e-7)
    port.reset_output_buffer()
    port.timeout = 0.1
    assert port.read(3) == b"d\r\n"


def test_an_input_buffer_can_be_dropped(port: Serial) -> None:
    port.write(b"B\n")
    port.timeout = 4.5 * BYTE + 0.0015
    assert port.read(1) == b"b"
    port.timeout = 2 * BYTE
    assert port.in_waiting == 0
    port.emulator.advance(port.now + 3 * BYTE)
    assert port.in_waiting == 3
    port.reset_input_buffer()
    assert port.in_waiting == 0
    # what has not arrived yet stays on its way
    assert port.readline() == b"01"
    port.timeout = 1
    assert port.readline() == b",5.00\r\n"


def test_modem_lines_and_breaks_do_no_harm(port: Serial) -> None:
    port.dtr = port.rts = False
    port.break_condition = True
    port.send_break()
    assert (port.cts, port.dsr, port.ri, port.cd) == (False,) * 4
    assert ask(port, b"B") == b"b,5.01,5.00\r\n"


def test_a_closed_port_refuses(port: Serial) -> None:
    port.close()
    for use in (lambda: port.read(1), lambda: port.write(b"B\n"), lambda: port.now):
        with pytest.raises(serial.SerialException):
            use()
    port.open()
    assert ask(port, b"B") == b"b,5.01,5.00\r\n"
    with pytest.raises(serial.SerialException, match="already open"):
        port.open()


@pytest.mark.parametrize("url", ["khepera://", "khepera://?seed=1"])
def test_without_an_arena_it_is_the_corridor(url: str) -> None:
    with open_port(url) as port, open_port("khepera://corridor?seed=1") as named:
        assert port.emulator.setup.arena == named.emulator.setup.arena
        assert port.emulator.setup.seed == ("seed=1" in url)


def test_miniterm_opens_a_robot() -> None:
    program = "import khepera_emulator; from serial.tools.miniterm import main; main()"
    started: list[Closing] = []
    terminal = Drive(started, [sys.executable, "-c", program, "khepera://"])
    try:
        terminal.wait_for(b"Quit: Ctrl+]")
        terminal.answer(b"B\r")
        terminal.wait_for(b"b,5.01,5.00")
        terminal.answer(b"\x1d")
        assert terminal.wait() == 0
    finally:
        terminal.close()


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("khepera://nowhere", "unknown arena 'nowhere'"),
        ("khepera:///", "the arena '/' is not a file"),
        ("khepera://corridor?colour=red", "unknown option 'colour'"),
        ("khepera://corridor?model=robot", "there is no robot model 'robot'; there are khepera"),
        ("khepera://corridor?drift=much", "cannot read the drift 'much'"),
        (
            "khepera://corridor?seed=x",
            "seed should be a valid integer, unable to parse string as an integer, not 'x'",
        ),
        (
            "khepera://corridor?seed=",
            "seed should be a valid integer, unable to parse string as an integer, not ''",
        ),
        ("khepera://corridor?seed=-1", "seed should be greater than or equal to 0, not '-1'"),
        (
            "khepera://corridor?dead-man=0",
            "dead-man should be greater than or equal to 0.01, not '0'",
        ),
        ("khepera://corridor?dead-man=inf", "dead-man should be a finite number, not 'inf'"),
        ("khepera://corridor?baud=fast", "baud: 'fast' is no rate; give auto, unpaced, or a rate"),
        ("khepera://corridor?baud=0", "baud: '0' is no rate"),
        ("khepera://corridor?sead=1", "unknown option 'sead'; did you mean seed?"),
        ("khepera://corridor?seed=1&seed=2", "seed is given twice"),
        ("khepera://corridor?fault=fire", "cannot read the fault 'fire'"),
    ],
)
def test_a_wrong_url_is_told_in_one_sentence(url: str, words: str) -> None:
    with pytest.raises(serial.SerialException) as caught:
        open_port(url)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_start_inside_a_wall_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "tight.toml"
    path.write_text(
        'version = 1\ntitle = "Tight"\nstart = { x = 0.0, y = 0.0 }\n'
        "free = { points = [[0.0, 0.0], [0.1, 0.0]], half_width = 0.05 }\n"
        "[[wall]]\npoints = [[0.02, -1.0], [0.02, 1.0]]\n"
    )
    with pytest.raises(serial.SerialException, match="no room for the robot"):
        open_port(f"khepera://{path}")


def test_khepera2_counts_in_fours() -> None:
    with open_port("khepera://corridor?model=khepera2") as port:
        assert ask(port, b"B") == b"b,5.02,5.01\r\n"
        assert {int(word) % 4 for word in ask(port, b"N").split(b",")[1:]} == {0}


IN_ANOTHER_PROCESS = """
import sys
sys.path.insert(0, sys.argv[1])
from test_khepera_url import open_port, session
from hashlib import sha256
with open_port("khepera://corridor?seed=" + sys.argv[2]) as port:
    print(sha256(repr(session(port)).encode()).hexdigest())
"""


def test_the_same_seed_gives_the_same_bytes_and_pictures_in_every_process(
    request: pytest.FixtureRequest,
) -> None:
    def digest(seed: int) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", IN_ANOTHER_PROCESS, str(request.path.parent), str(seed)]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    first, same, other = digest(1), digest(1), digest(2)
    digests = [process.communicate(timeout=60)[0].splitlines()[-1] for process in (first, same)]
    assert len(digests[0]) == 64
    assert digests[0] == digests[1]
    assert other.communicate(timeout=60)[0].splitlines()[-1] != digests[0]


def test_another_seed_gives_another_robot() -> None:
    drifts, pictures = [], []
    for seed in (1, 2):
        with open_port(f"khepera://corridor?seed={seed}") as port:
            drifts.append(port.emulator.truth().drift)
            pictures.append(port.emulator.mirror_image())
    assert drifts[0] != drifts[1]
    assert not np.array_equal(*pictures)


@pytest.mark.parametrize("past", [0.0, 0.0012345, 0.1, 1 / 3, 12345.6789])
def test_a_seeded_reset_has_no_past(past: float) -> None:
    with open_port("khepera://corridor?seed=7") as fresh:
        expected = session(fresh, Reset(seed=7))
    with open_port("khepera://corridor?seed=7") as used:
        ask(used, b"D,7,5")
        used.timeout = 0.05
        used.read(1)
        used.emulator.mirror_image()
        ask(used, b"P,0,0")
        used.timeout = past
        used.read(1)
        ask(used, b"D,9,9")
        # half a request on the wire, half a reply under way
        used.write(b"N\nH\nD,9,")
        used.timeout = 0.003
        used.read(1)
        before = used.now
        assert session(used, Reset(seed=7)) == expected
        assert used.now > before
        used.timeout = past
        assert session(used, Reset(seed=7)) == expected


def test_a_seeded_reset_equals_a_fresh_port() -> None:
    with open_port("khepera://corridor?seed=7") as fresh:
        expected = session(fresh)
    with open_port("khepera://corridor?seed=7") as used:
        session(used)
        assert session(used, Reset(seed=7)) == expected


def test_a_robot_keeps_its_wheels_over_a_reset() -> None:
    with open_port("khepera://corridor?seed=7") as port:
        drift = port.emulator.truth().drift
        assert port.emulator.reset(Reset(seed=8)).drift == drift
    with open_port("khepera://corridor?seed=8") as port:
        assert port.emulator.truth().drift != drift


def test_a_random_place_depends_on_the_seed_alone() -> None:
    with open_port("khepera://corridor?seed=1") as port:
        reset = port.emulator.reset
        place = reset(Reset(seed=5, random=True)).pose
        second = reset(Reset(random=True)).pose
        assert second != place
        assert reset(Reset(seed=6, random=True)).pose != place
        assert reset(Reset(seed=5, random=True)).pose == place
        assert reset(Reset(random=True)).pose == second


def test_a_reset_puts_the_robot_down_at_rest(port: Serial) -> None:
    assert ask(port, b"D,10,10") == b"d\r\n"
    port.timeout = 1
    port.read(1)
    port.write(b"H\nH\n")
    truth = port.emulator.reset(Reset(pose=Pose(x=0.2, y=0.01, heading=0.5)))
    assert truth.pose == Pose(x=0.2, y=0.01, heading=0.5)
    assert truth.speed == (0.0, 0.0)
    assert not truth.touched
    assert port.read(100) == b""
    assert ask(port, b"H") == b"h,0,0\r\n"
    assert port.emulator.truth().pose == truth.pose


def test_sensors_see_the_new_place_at_once() -> None:
    with open_port("khepera://corridor?baud=unpaced") as port:
        assert max(map(int, ask(port, b"N").split(b",")[1:])) < 50
        port.emulator.reset(Reset(pose=Pose(x=1.09, y=0.0, heading=0.0)))
        assert max(map(int, ask(port, b"N").split(b",")[1:])) > 900


@pytest.mark.parametrize("seed", [None, 9])
def test_a_place_that_is_not_free_is_refused_and_changes_nothing(
    port: Serial, seed: int | None
) -> None:
    ask(port, b"D,10,10")
    before = port.emulator.truth()
    with pytest.raises(EmulatorError, match="no room for the robot"):
        port.emulator.reset(Reset(pose=Pose(x=1.12, y=0.0, heading=0.0), seed=seed))
    assert port.emulator.truth() == before
    assert ask(port, b"K").startswith(b"k,0,1,")


def test_time_does_not_run_back(port: Serial) -> None:
    port.emulator.advance(2.0)
    port.emulator.advance(1.0)
    assert port.now == 2.0


def test_how_time_is_cut_makes_no_difference() -> None:
    def drive(steps: int) -> tuple[bytes, Pose]:
        with open_port("khepera://corridor?seed=4") as port:
            port.write(b"D,6,5\nN\nH\n")
            for step in range(steps):
                port.emulator.advance(port.now + (1.5 - port.now) / (steps - step))
            return port.emulator.read(), port.emulator.truth().pose

    assert drive(1) == drive(7) == drive(1501)


def test_opens_in_a_process_whose_error_output_is_closed() -> None:
    program = (
        "import serial, khepera_emulator\n"
        "port = serial.serial_for_url('khepera://corridor', timeout=1)\n"
        "port.write(b'B\\n')\n"
        "print(port.readline())\n"
    )
    command = ["sh", "-c", 'exec "$0" -c "$1" 2>&-', sys.executable, program]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, timeout=60)
    assert done.stdout == "b'b,5.01,5.00\\r\\n'\n"


def test_refused_requests_are_logged_with_cleaned_text_and_not_without_end(
    port: Serial, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    port.write(b"\x1b[31mM\nD,5\nD,5,5\nT,1,B\n")
    port.read(100)
    assert [record.getMessage() for record in caplog.records] == [
        r"robot 1 refuses '\x1b[31mM': '\x1b[31mM' begins with no command or tool",
        "robot 1 refuses 'D,5': D takes 2 argument(s)",
        "robot 1 refuses 'T,1,B': no turret 1 is mounted",
    ]
    port.write(b"M\n" * 100)
    port.read(10_000)
    assert len(caplog.records) == 21
    port.emulator.hang_up()
    assert caplog.records[-1].getMessage() == "robot 1 has refused 103 requests"
