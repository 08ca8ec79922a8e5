"""Turrets and switches on whole robots: behind the line, in the world, from robot to robot."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import serial
from in_process import open_robot
from khepera_protocol.zenoh.payloads import Pose, Reset

import khepera_emulator  # noqa: F401 - registers the URL scheme
from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.body.drift import PRESETS
from khepera_emulator.robot.emulator import Emulator, Setup, make_fleet
from khepera_emulator.turrets.catalogue import find_turrets
from khepera_emulator.turrets.general_io import GeneralIO

BENCH = Path(__file__).parent / "golden" / "bench.toml"
SEND = b"T,4,S,2,3,72,105,33" + 13 * b",0"


@pytest.fixture
def make() -> Iterator[Callable[..., list[Emulator]]]:
    made: list[Emulator] = []

    def make_robots(*turrets: str, arena: str = str(BENCH), size: int = 1) -> list[Emulator]:
        setup = Setup(
            load_arena(arena), drift=PRESETS["none"], baud=None, turrets=find_turrets(turrets)
        )
        robots = make_fleet(setup, size)
        made.append(robots[0])
        return robots

    yield make_robots
    for robot in made:
        robot.close()


def ask(robot: Emulator, line: bytes) -> bytes:
    robot.write(line + b"\n")
    robot.advance(robot.now)
    return robot.read()


def wait(robot: Emulator, seconds: float) -> None:
    robot.advance(robot.now + seconds)


def test_robots_of_one_world_talk_by_radio(make: Callable[..., list[Emulator]]) -> None:
    one, two = make("radio", arena="open-box", size=2)
    assert ask(one, SEND) == b"t,4,s\r\n"
    wait(one, 0.1)
    assert ask(one, b"T,4,F") == b"t,4,f,1\r\n"
    assert ask(two, b"T,4,F") == b"t,4,f,3\r\n"
    assert ask(two, b"T,4,R") == b"t,4,r,1,3,72,105,33" + 13 * b",0" + b"\r\n"


def test_a_message_arrives_while_robots_drive_and_after_a_reset(
    make: Callable[..., list[Emulator]],
) -> None:
    one, two = make("radio", arena="open-box", size=2)
    one.reset(Reset(seed=5))
    ask(one, b"D,3,-3")
    ask(one, SEND)
    wait(one, 0.04)
    assert ask(two, b"T,4,F") == b"t,4,f,1\r\n"
    wait(one, 0.02)
    assert ask(two, b"T,4,F") == b"t,4,f,3\r\n"


def test_robots_of_two_worlds_do_not_hear_each_other(make: Callable[..., list[Emulator]]) -> None:
    (one,), (_other,) = make("radio"), make("radio")
    ask(one, SEND.replace(b"S,2", b"S,1"))
    wait(one, 0.1)
    assert ask(one, b"T,4,F") == b"t,4,f,5\r\n"


def grasp(robot: Emulator) -> None:
    for line, seconds in ((b"T,1,E,255", 1.0), (b"T,1,D,1", 0.6), (b"T,1,E,150", 1.0)):
        ask(robot, line)
        wait(robot, seconds)


def test_what_is_lifted_leaves_the_floor_and_comes_back(
    make: Callable[..., list[Emulator]],
) -> None:
    (robot,) = make("gripper")
    ahead = [int(value) for value in ask(robot, b"N").split(b",")[3:5]]
    assert min(ahead) > 100
    grasp(robot)
    assert max(int(value) for value in ask(robot, b"N").split(b",")[3:5]) < 20
    ask(robot, b"C,-1000,-1000")
    wait(robot, 6.0)
    (thing,) = robot.robot.chassis._world.things
    assert thing.footprint.x == pytest.approx(-0.080 + 0.0475, abs=1e-3)
    ask(robot, b"T,1,E,255")
    wait(robot, 1.0)
    ask(robot, b"T,1,D,0")
    wait(robot, 0.6)
    assert min(int(value) for value in ask(robot, b"N").split(b",")[3:5]) > 100
    # it can be pushed again
    ask(robot, b"D,5,5")
    wait(robot, 2.0)
    assert thing.footprint.x > 0.0


def test_a_robot_drives_on_below_what_it_carries(make: Callable[..., list[Emulator]]) -> None:
    (robot,) = make("gripper")
    grasp(robot)
    ask(robot, b"C,1000,1000")
    wait(robot, 6.0)
    assert robot.truth().pose.x == pytest.approx(0.080, abs=1e-3)
    assert not robot.truth().touched


def test_a_reset_empties_the_fingers(make: Callable[..., list[Emulator]]) -> None:
    (robot,) = make("gripper")
    grasp(robot)
    robot.reset(Reset(pose=Pose(x=-0.2, y=0.0, heading=0.0)))
    assert ask(robot, b"T,1,F") == b"t,1,f,0\r\n"
    assert ask(robot, b"T,1,H,0") == b"t,1,h,255\r\n"
    assert len(robot.robot.chassis._world.movers) == 1
    robot.reset(Reset(seed=1))
    grasp(robot)
    assert ask(robot, b"T,1,F") == b"t,1,f,200\r\n"


def test_general_io_answers_on_the_line(make: Callable[..., list[Emulator]]) -> None:
    (robot,) = make("general-io")
    (turret,) = robot.robot.turrets.turrets
    assert isinstance(turret, GeneralIO)
    turret.inputs = 6
    turret.volts[5] = 1000
    assert ask(robot, b"R,32") == b"r,6\r\n"
    assert ask(robot, b"R,33") == b"r,255\r\n"
    assert ask(robot, b"I,5") == b"i,1000\r\n"
    assert ask(robot, b"I,0") == b"i,600\r\n"
    assert ask(robot, b"W,9,32") == b"w\r\n"
    assert turret.outputs == 9
    ask(robot, b"restart")
    assert turret.outputs == 9
    robot.reset(Reset())
    assert turret.outputs == 0


def test_turrets_do_not_change_what_happens_otherwise(make: Callable[..., list[Emulator]]) -> None:
    def drive(*turrets: str) -> list[bytes]:
        (robot,) = make(*turrets, arena="corridor")
        answers = []
        for line in (b"N", b"D,9,7", b"O", b"H", b"N", b"E"):
            answers.append(ask(robot, line))
            wait(robot, 0.3)
        return answers

    assert drive() == drive("gripper", "k213", "radio", "general-io")


def test_the_tool_serial_sets_the_rate_after_its_reply() -> None:
    character = 11 / 9600
    with open_robot("khepera://corridor", timeout=1) as port:
        port.write(b"serial 38400\n")
        answer = port.readline()
        assert port.now == pytest.approx((13 + len(answer)) * character + 0.0015, abs=1e-6)
        before = port.now
        port.write(b"B\n")
        port.readline()
        assert port.now - before == pytest.approx(15 * character / 4 + 0.0015, abs=1e-6)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ("turret=arm", "there is no turret 'arm'; there are gripper"),
        ("turret=radio&turret=radio", "twice"),
        ("firmware=fast", "unknown firmware option 'fast'"),
    ],
)
def test_wrong_options_of_a_url(options: str, reason: str) -> None:
    with pytest.raises(serial.SerialException, match=reason):
        open_robot(f"khepera://corridor?{options}")
