"""A robot that ROS drives: it moves as it is told, and stands half a second after the last word."""

import signal
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import pairwise
from math import inf, nan
from typing import Any

import pytest
from as_type import not_none
from controller_helpers import free_endpoint
from drives import STATUSES, WAYS_OUT, Drive
from hand_drives import Joystick, driven_by_ros
from khepera_protocol.serial.units import PULSE
from khepera_protocol.zenoh.keys import CONTROLLER_ALIVE
from rig import STANDING, Rig, rig
from rosbags.typesys.stores import ros2_jazzy as ros

from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import DriveSettings
from macor_hil.hardware.khepera import Khepera, open_port
from macor_hil.hardware.robots.form import Reading
from macor_hil.runs.by_hand.rolling import LIMIT, Rolling
from macor_hil.runs.by_hand.ros_drive import _DrivenRobot
from macor_hil.telemetry.ros2.messages import cdr, header, twist
from macor_hil.telemetry.ros2.twists import Twist, read_twist
from macor_hil.telemetry.session import open_session


@pytest.mark.parametrize("frame", ["", "a", "base", "base_link", "khepera/base_link"])
def test_twists_are_read_as_ros_writes_them(frame: str) -> None:
    assert read_twist(cdr(twist(0.1, -0.5)), stamped=False) == (0.1, -0.5)
    stamped = ros.geometry_msgs__msg__TwistStamped(header(1, frame), twist(0.1, -0.5))
    assert read_twist(cdr(stamped), stamped=True) == (0.1, -0.5)


GOOD = cdr(twist(0.1, 0.2))
ODD = {
    "empty": b"",
    "cut off": GOOD[:-1],
    "too long": GOOD + b"\0",
    "big endian": b"\0\0" + GOOD[2:],
    "not a number": cdr(twist(nan, 0.0)),
    "infinite": cdr(twist(0.1, inf)),
    "far too fast": cdr(twist(1e9, 0.0)),
    "no header": b"\0\1\0\0" + bytes(4),
    "a name without an end": b"\0\1\0\0" + struct.pack("<iII", 1, 2, 2**32 - 1) + bytes(56),
    "huge": b"\0\1\0\0" + bytes(100_000),
}


@pytest.mark.parametrize("odd", ODD)
def test_what_is_no_twist_moves_nothing(odd: str) -> None:
    assert read_twist(ODD[odd], stamped=False) is None
    assert read_twist(ODD[odd], stamped=True) is None


def in_virtual_time(*, infrared: int = 1000, baud: int = 9600) -> tuple[Khepera, Rolling]:
    robot = Khepera(open_port("khepera://open-box?seed=1&drift=none", baud))
    robot.connect()
    return robot, Rolling(robot, DriveSettings(collision=infrared))


def speeds(robot: Khepera, seconds: float, look: Callable[[], object]) -> list[tuple[float, float]]:
    """Clock and speed of the faster wheel, until a time has passed."""
    end = robot.clock() + seconds
    seen = []
    while robot.clock() < end:
        truth = robot.port.emulator.truth()
        seen.append((robot.clock(), max(map(abs, truth.speed))))
        look()
        robot.port.emulator.advance(robot.clock() + 0.01)
    return seen


MOTIONS = [(0.16, 0.0), (-0.16, 0.0), (0.1, 2.0), (0.0, -3.0), (9.0, 0.0)]


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("looks_on", [True, False])
def test_a_single_word_is_driven_for_a_moment(motion: tuple[float, float], looks_on: bool) -> None:
    robot, rolling = in_virtual_time()

    def look() -> None:
        rolling.look()
        rolling.roll()

    for rolls in (0.0, 0.5):  # from rest, and while it rolls
        for _ in range(round(rolls / 0.1) + 1):
            rolling.go(*motion)
            rolling.roll()
            robot.wait(0.1 if rolls else 0.0)
        told = robot.clock()
        seen = speeds(robot, 1.0, look if looks_on else lambda: ())
        assert max(speed for _, speed in seen) > 0.03
        assert max(when for when, speed in seen if speed > 0.004) - told < LIMIT


@pytest.mark.parametrize("speed", [0.04, 0.08, 0.128])
@pytest.mark.parametrize("baud", [9600, 57600])
def test_words_that_follow_each_other_are_one_drive(speed: float, baud: int) -> None:
    robot, rolling = in_virtual_time(baud=baud)
    seen: list[tuple[float, float]] = []
    for _ in range(20):
        rolling.go(speed, 0.0)
        end = robot.clock() + 0.1
        while robot.clock() < end:
            rolling.look()
            rolling.roll()
            seen += speeds(robot, 0.03, lambda: ())  # for which samples are forwarded
    steady = [speed for when, speed in seen if when > seen[0][0] + 0.5]
    assert sum(steady) / len(steady) == pytest.approx(speed, rel=0.05)
    assert min(steady) > 0.8 * speed


def test_a_motion_is_the_one_that_was_told() -> None:
    robot, rolling = in_virtual_time()
    before = robot.port.emulator.truth().pose
    for _ in range(10):
        rolling.go(0.08, 1.0)
        rolling.roll()
        robot.wait(0.1)
    after = robot.port.emulator.truth().pose
    turn, way = after.heading - before.heading, robot.counters()
    assert turn / ((way[0] + way[1]) / 2 * 0.00008) == pytest.approx(
        1.0 / 0.08, rel=0.12
    )  # multiples of 8 mm/s a wheel


class Written:
    """In the place of bridge, twists and controllers: a joystick that is held, and what is told."""

    there = False

    def __init__(self) -> None:
        self.told: list[tuple[float, int]] = []

    def latest(self) -> Twist:
        return Twist(0.08, 0.0, time.monotonic())

    def meet(self, _: object) -> None:
        pass

    def forward(self, _: float) -> bool:
        return False

    def sense(self, told: Reading, when: float) -> None:
        self.told.append((when, not_none(told.counters)[0]))


def test_a_question_for_the_battery_bends_no_speed() -> None:
    with open_hardware("khepera://open-box?seed=1", baud=9600) as hardware:
        written: Any = Written()
        node = _DrivenRobot(hardware.robot, written, written, written, DriveSettings())
        for turn in range(40):
            if turn % 3 == 0:
                node._asked_battery = -inf
            node.turn()
            hardware.robot.wait(0.03)
    steady = written.told[15:]
    speeds = [(b[1] - a[1]) * PULSE / (b[0] - a[0]) for a, b in pairwise(steady)]
    assert min(speeds) > 0.08 * 0.85
    assert max(speeds) < 0.08 * 1.15


def test_what_is_ahead_stops_the_robot_and_the_way_back_is_free() -> None:
    robot, rolling = in_virtual_time(infrared=1)
    rolling.go(0.1, 0.0)
    rolling.roll()
    while max(rolling.look()[:6]) < 1:
        rolling.go(0.1, 0.0)
        rolling.roll()
    robot.wait(0.1)
    assert robot.request("E").values == (0, 0)
    rolling.go(0.1, 0.0)
    rolling.roll()
    robot.wait(0.1)
    assert robot.request("E").values == (0, 0)
    rolling.go(-0.1, 0.0)
    rolling.roll()
    robot.wait(0.1)
    assert max(robot.request("E").values) < 0


@pytest.fixture(scope="module")
def shared_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with rig(tmp_path_factory.mktemp("ros"), relay=False) as running:
        yield running


@pytest.fixture
def bench(shared_bench: Rig) -> Iterator[Rig]:
    shared_bench.make_ready()
    yield shared_bench
    shared_bench.end_controllers()


@pytest.mark.wall_clock
@pytest.mark.parametrize("stamped", [False, True])
def test_a_robot_that_hears_nothing_more_stands(bench: Rig, stamped: bool) -> None:
    drive = driven_by_ros(bench)
    with open_session([free_endpoint()], [bench.endpoint]) as session:
        joystick = Joystick(session, stamped)
        assert bench.stops_within(LIMIT, lambda: joystick.push(bench))
    drive.signal(signal.SIGTERM)
    assert drive.wait() == 0


ENDS: dict[str, Callable[[Drive], None]] = {
    **WAYS_OUT,
    "SIGKILL": lambda drive: drive.signal(signal.SIGKILL),
    "SIGSTOP": lambda drive: drive.signal(signal.SIGSTOP),
}


@pytest.mark.wall_clock
@pytest.mark.parametrize(
    "way",
    [pytest.param(way, marks=() if way == "SIGKILL" else pytest.mark.long) for way in ENDS],
)
def test_every_way_out_stops_a_robot_that_ros_drives(bench: Rig, way: str) -> None:
    drives: list[Drive] = []

    def attempt() -> None:
        bench.make_ready()
        drives.append(driven_by_ros(bench))
        with open_session([free_endpoint()], [bench.endpoint]) as session:
            Joystick(session, stamped=False).push(bench)
            ENDS[way](drives[-1])

    assert bench.stops_within(LIMIT, attempt)
    if way in STATUSES:
        assert drives[-1].wait() == STATUSES[way]


@pytest.mark.long
@pytest.mark.wall_clock
def test_ros_never_drives_beside_a_controller(bench: Rig) -> None:
    drive = driven_by_ros(bench)
    with (
        open_session([free_endpoint()], [bench.endpoint]) as session,
        ExitStack() as controller,
    ):
        joystick = Joystick(session, stamped=False)

        def attempt() -> None:
            controller.close()
            joystick.push(bench)
            token = session.liveliness().declare_token(CONTROLLER_ALIVE.of("khepera"))
            controller.enter_context(token)

        assert bench.stops_within(LIMIT, attempt)
        for _ in range(20):
            joystick.say()
        assert bench.truth()[1] < STANDING
        refused = driven_by_ros(bench)
        assert refused.wait() == 2
        refused.wait_for(b"a controller drives khepera; end it first")
        controller.close()
        joystick.push(bench)
    drive.signal(signal.SIGTERM)
    assert drive.wait() == 0
