"""Effects of each of the 18 commands on the robot; nothing on the line ever raises."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from khepera_protocol.serial.commands import COMMANDS, TOOLS
from khepera_protocol.serial.framing import RequestSplitter
from khepera_protocol.zenoh.payloads import Pose, WheelDrift

from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.body.motors import Gains, Mode, Profile
from khepera_emulator.models import KHEPERA, KHEPERA2, KheperaModel
from khepera_emulator.robot.khepera.firmware import Firmware
from khepera_emulator.robot.khepera.robot import Robot
from khepera_emulator.world.world import World

NO_DRIFT = WheelDrift(left_scale=1.0, right_scale=1.0, wheel_base=0.053, slip=0.0)

BANNER = (
    b"ROM of minirobot KHEPERA, Edoardo Franzi K-Team S.A. October 22, 1998 Rev. 5.01\r\n"
    b"Serial Communication Protocol\r\n"
)


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    made = World(load_arena("corridor"))
    yield made
    made.close()


def make(world: World, model: KheperaModel = KHEPERA) -> Robot:
    pose = Pose(x=0.3, y=0.0, heading=0.0)
    return Robot(world, model, pose, NO_DRIFT, np.random.default_rng(0))


@pytest.fixture
def robot(world: World) -> Robot:
    return make(world)


@pytest.fixture
def ask(robot: Robot) -> Callable[[bytes], bytes]:
    return Firmware(robot).execute


def ticks(robot: Robot, count: int) -> None:
    for _ in range(count):
        robot.tick()


def test_a_configures_the_speed_controller(robot: Robot, ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"A,1000,200,30") == b"a\r\n"
    assert [wheel.speed_gains for wheel in robot.wheels] == [Gains(1000, 200, 30)] * 2


def test_b_reads_the_versions(world: World, ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"B") == b"b,5.01,5.00\r\n"
    assert Firmware(make(world, KHEPERA2)).execute(b"B") == b"b,5.02,5.01\r\n"


def test_c_goes_to_a_position(robot: Robot, ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"C,100,-100") == b"c\r\n"
    assert ask(b"K") == b"k,0,0,100,0,0,-100\r\n"
    ticks(robot, 200)
    assert ask(b"H") in (b"h,%d,%d\r\n" % (a, b) for a in (99, 100, 101) for b in (-101, -100, -99))
    assert ask(b"K").startswith(b"k,1,0,")


def test_d_sets_and_e_reads_the_speed(robot: Robot, ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"D,10,-5") == b"d\r\n"
    ticks(robot, 100)
    left, right = map(int, ask(b"E").decode().strip().split(",")[1:])
    assert left == pytest.approx(10, abs=1)
    assert right == pytest.approx(-5, abs=1)
    status = ask(b"K").decode().strip().split(",")
    assert [status[1], status[2], status[4], status[5]] == ["0", "1", "0", "1"]
    assert int(status[3]) == 10 - left
    assert int(status[6]) == -5 - right


def test_f_configures_the_position_controller(robot: Robot, ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"F,1,2,3") == b"f\r\n"
    assert [wheel.position_gains for wheel in robot.wheels] == [Gains(1, 2, 3)] * 2


def test_g_sets_and_h_reads_the_counters(ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"G,2147483647,-2147483648") == b"g\r\n"
    assert ask(b"H") == b"h,2147483647,-2147483648\r\n"


def test_i_reads_an_input(robot: Robot, ask: Callable[[bytes], bytes]) -> None:
    robot.panel.analogue[3] = 512
    assert ask(b"I,3") == b"i,512\r\n"
    assert ask(b"I,0") == b"i,600\r\n"


def test_j_configures_each_wheel_profile(robot: Robot, ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"J,30,40,50,60") == b"j\r\n"
    assert [wheel.profile for wheel in robot.wheels] == [Profile(30, 40), Profile(50, 60)]


def test_k_after_power_on(ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"K") == b"k,0,1,0,0,1,0\r\n"


def test_l_changes_the_leds(robot: Robot, ask: Callable[[bytes], bytes]) -> None:
    assert robot.panel.leds == [False, False]
    for request, leds in (
        (b"L,1,2", [False, True]),
        (b"L,1,2", [False, False]),
        (b"L,0,1", [True, False]),
        (b"L,0,1", [True, False]),
        (b"L,0,0", [False, False]),
    ):
        assert ask(request) == b"l\r\n"
        assert robot.panel.leds == leds


@pytest.mark.parametrize(("request_line", "letter"), [(b"N", b"n"), (b"O", b"o")])
def test_n_and_o_read_the_latest_scan(
    robot: Robot, ask: Callable[[bytes], bytes], request_line: bytes, letter: bytes
) -> None:
    first = ask(request_line)
    assert first.split(b",")[0] == letter
    assert len(first.split(b",")) == 9
    assert all(0 <= int(value) <= 1023 for value in first.split(b",")[1:])
    ticks(robot, 1)
    assert ask(request_line) == first
    ticks(robot, 1)
    assert ask(request_line) != first


def test_p_sets_the_duty(robot: Robot, ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"P,128,-128") == b"p\r\n"
    assert [wheel.mode for wheel in robot.wheels] == [Mode.DUTY] * 2
    assert [wheel.set_duty for wheel in robot.wheels] == [128, -128]
    assert ask(b"K") == b"k,0,1,0,0,1,0\r\n"


def test_r_and_w_use_the_bus(robot: Robot, ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"R,32") == b"r,255\r\n"
    robot.panel.inputs[32] = 15
    assert ask(b"R,32") == b"r,15\r\n"
    assert ask(b"W,15,33") == b"w\r\n"
    assert robot.panel.outputs == {33: 15}


@pytest.mark.parametrize("line", [b"T,1,B", b"T,2,N", b"T,255,X,1"])
def test_t_finds_no_turret(ask: Callable[[bytes], bytes], line: bytes) -> None:
    assert ask(line) == b"z,Turret order not supported\r\n"


@pytest.mark.parametrize("last", [b"C,50,50", b"D,3,3", b"P,40,40"])
@pytest.mark.parametrize("first", [b"C,50,50", b"D,3,3", b"P,40,40"])
def test_the_last_of_c_d_and_p_wins(
    robot: Robot, ask: Callable[[bytes], bytes], first: bytes, last: bytes
) -> None:
    ask(first)
    ticks(robot, 5)
    ask(last)
    modes = {b"C": Mode.POSITION, b"D": Mode.SPEED, b"P": Mode.DUTY}
    assert {wheel.mode for wheel in robot.wheels} == {modes[last[:1]]}


def test_restart_sends_the_banner_and_sets_everything_back(
    robot: Robot, ask: Callable[[bytes], bytes]
) -> None:
    for line in (b"D,10,10", b"A,1,1,1", b"F,1,1,1", b"J,1,1,1,1", b"L,1,1", b"W,1,1"):
        ask(line)
    ticks(robot, 50)
    place = robot.chassis.pose
    assert ask(b"restart") == BANNER
    assert ask(b"H") == b"h,0,0\r\n"
    assert ask(b"K") == b"k,0,1,0,0,1,0\r\n"
    assert robot.panel.leds == [False, False]
    assert robot.panel.outputs == {}
    wheel = robot.wheels[0]
    assert wheel.speed_gains == Gains(3800, 800, 100)
    assert wheel.position_gains == Gains(3000, 20, 4000)
    assert wheel.profile == Profile(20, 64)
    ticks(robot, 50)
    assert robot.chassis.pose == place


def test_there_is_no_watchdog(robot: Robot, ask: Callable[[bytes], bytes]) -> None:
    ask(b"D,5,-5")
    ticks(robot, 6000)
    assert robot.wheels[0].counter == pytest.approx(30_000, rel=0.01)


@pytest.mark.parametrize("word", sorted(TOOLS))
def test_every_tool_answers_in_lines(ask: Callable[[bytes], bytes], word: str) -> None:
    answer = ask(word.encode())
    assert answer.endswith(b"\r\n")
    assert all(line and line.isascii() for line in answer.removesuffix(b"\r\n").split(b"\r\n"))


def test_memory_is_told_as_by_a_real_robot(ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"memory").startswith(b"First free ROM address:   16'00012490, used 57%\r\n")


@pytest.mark.parametrize("line", [b"M", b" ", b"n", b"?", b"run nothing"])
def test_unknown_words_are_not_found(ask: Callable[[bytes], bytes], line: bytes) -> None:
    assert ask(line) == b"Command not found\r\n"


def test_a_wrong_number_of_arguments_is_a_protocol_error(ask: Callable[[bytes], bytes]) -> None:
    assert ask(b"D,5") == b"z,Protocol error\r\n"


tokens = st.sampled_from([*COMMANDS, *TOOLS, ",", "-", " ", "0", "1", "999", "\r", "\n", "\r\n"])
talk = st.lists(tokens, max_size=40).map("".join).map(str.encode)


@given(st.binary(max_size=200) | talk)
@example(b"\0\r")
def test_every_line_gets_one_reply_and_nothing_raises(world: World, data: bytes) -> None:
    robot = make(world)
    firmware, splitter = Firmware(robot), RequestSplitter()
    # NULs are nothing, wherever they come
    heard = data.replace(b"\0", b"")
    lines = heard.replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")[:-1]
    requests = splitter.feed(data)
    assert len(requests) == sum(len(line) > 0 for line in lines)
    for request in requests:
        reply = firmware.execute(request)
        assert reply.endswith(b"\r\n")
        is_tool = any(request.startswith(word.encode()) for word in TOOLS)
        assert is_tool or reply.count(b"\r\n") == 1
        robot.tick()
