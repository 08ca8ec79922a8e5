"""The controller drives an e-puck as it drives a Khepera: the same commands, collisions, stops."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees, hypot, pi

import pytest
import serial
from as_type import not_none
from emulator_process import emulator
from khepera_protocol.zenoh.payloads import Pose, Reset

from macor_hil.commands import COMMANDS, STRAIGHT
from macor_hil.errors import LinkError, RobotError
from macor_hil.hardware.address import PortAddress
from macor_hil.hardware.devices import Hardware, open_hardware, robot_of
from macor_hil.hardware.driver import Driver
from macor_hil.hardware.khepera import Khepera
from macor_hil.hardware.robots.epuck.client import Epuck
from macor_hil.hardware.robots.epuck.servo import Servo
from macor_hil.hardware.robots.epuck.wifi import WifiEpuck
from macor_hil.hardware.robots.robot import RobotKind

MIDDLE = Pose(x=0.0, y=0.0, heading=0.0)
WIFI = "epuck2&profile=wifi"
MODELS = pytest.mark.parametrize("model", ["epuck", "epuck2", WIFI])


@contextmanager
def puck(
    model: str = "epuck2", arena: str = "open-box", more: str = "", baud: int = 38_400
) -> Iterator[Hardware]:
    url = f"khepera://{arena}?model={model}&seed=1&drift=none{more}"
    with open_hardware(url, baud=baud) as hardware:
        if arena == "open-box":
            not_none(hardware.bench).reset(Reset(pose=MIDDLE))
            hardware.robot.connect()
        yield hardware


def pose(hardware: Hardware) -> Pose:
    return not_none(hardware.bench).truth().pose


@MODELS
def test_commands_are_those_of_a_khepera(model: str) -> None:
    with puck(model, baud=115_200) as hardware:
        driver = Driver(hardware.robot)
        driver.start()
        for command in COMMANDS:
            before = pose(hardware)
            assert not driver.execute(command).collided
            after = pose(hardware)
            way = hypot(after.x - before.x, after.y - before.y)
            assert way == pytest.approx(command.way, abs=0.0005)
            turned = degrees(after.heading - before.heading)
            assert turned == pytest.approx(degrees(command.turn), abs=0.3)


@MODELS
def test_walls_are_collisions_before_they_are_touched(model: str) -> None:
    with puck(model, "corridor") as hardware:
        driver = Driver(hardware.robot)
        driver.start()
        for _ in range(100):
            outcome = driver.execute(STRAIGHT)
            if outcome.collided:
                break
        assert outcome.collided
        hardware.robot.wait(0.05)
        truth = not_none(hardware.bench).truth()
        assert not truth.touched
        assert truth.speed == (0.0, 0.0)


def test_legs_and_turns_come_to_their_ends() -> None:
    with puck() as hardware:
        driver = Driver(hardware.robot)
        driver.start()
        assert not driver.leg(0.3, 0.0).collided
        assert pose(hardware).x == pytest.approx(0.3, abs=0.001)
        assert not driver.leg(0.0, pi / 2).collided
        assert pose(hardware).heading == pytest.approx(pi / 2, abs=0.01)
        driver.turn(-pi / 2)
        assert pose(hardware).heading == pytest.approx(0.0, abs=0.015)
        driver.back_off(1)


def test_speeds_are_held_and_cut_to_what_it_can() -> None:
    with puck() as hardware:
        driver = Driver(hardware.robot)
        assert driver.settings.speed == Epuck.top_speed == 16
        driver.start()
        outcome = driver.hold(5, 5, 1.0)
        assert outcome.counters[0] == pytest.approx(500, abs=25)
        assert pose(hardware).x == pytest.approx(0.040, abs=0.002)


def test_counters_go_on_when_the_robots_wrap() -> None:
    with puck("epuck") as hardware:
        hardware.robot.set_counters(0, 0)
        hardware.robot.port.emulator.robot.motors[0].counter = 32_700
        hardware.robot.port.emulator.robot.motors[1].counter = 32_700
        hardware.robot.connect()
        driver = Driver(hardware.robot)
        driver.start()
        assert not driver.leg(0.05, 0.0).collided
        assert hardware.robot.counters() == pytest.approx((625, 625), abs=4)


@pytest.mark.parametrize(
    "fault",
    [
        "flip:p=0.0003",
        pytest.param("drop:p=0.0003", marks=pytest.mark.long),
        pytest.param("stray:p=0.01", marks=pytest.mark.long),
    ],
)
def test_a_bad_line_is_asked_again(fault: str) -> None:
    with puck(more=f"&fault={fault}") as hardware:
        driver = Driver(hardware.robot)
        driven = 0
        for _ in range(11):
            try:
                hardware.robot.recover(5.0)
                driver.start()
                driven += not driver.execute(STRAIGHT).collided
            except RobotError:
                hardware.robot.wait(0.05)
                assert not_none(hardware.bench).truth().speed == (0.0, 0.0)
        assert driven >= 7
        assert hardware.robot.meter.failures > 0


def test_a_port_that_fails_is_a_failed_request(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(_: bytes) -> int:
        raise serial.SerialException("device reports readiness but returned no data")

    with puck() as hardware:
        before = hardware.robot.meter.read()
        with monkeypatch.context() as cut:
            cut.setattr(hardware.robot.port, "write", gone)
            with pytest.raises(LinkError, match="port failed"):
                hardware.robot.counters()
        after = hardware.robot.meter.read()
        assert (after.exchanges, after.failures) == (before.exchanges, before.failures + 1)


@MODELS
def test_a_reset_is_noticed_and_counters_go_on(model: str) -> None:
    with puck(model, more="&fault=reset:at=3") as hardware:
        driver = Driver(hardware.robot)
        driver.start()
        with pytest.raises(RobotError):
            driver.hold(5, 5, 8.0)
        assert hardware.robot.recover(5.0)
        left, right = hardware.robot.counters()
        assert left == right > 900  # two seconds and more at 500 a second
        assert not hardware.robot.recover(5.0)


def test_a_robot_that_was_put_elsewhere_begins_there() -> None:
    with puck() as hardware:
        driver = Driver(hardware.robot)
        for _ in range(2):
            driver.start()
            driver.leg(0.1, 0.0)
            not_none(hardware.bench).reset(Reset(seed=3))
            driver.start()
            assert hardware.robot.counters() == (0, 0)
            assert not driver.execute(STRAIGHT).collided


@pytest.mark.parametrize("model", ["epuck2", WIFI])
def test_an_error_while_it_drives_leaves_it_standing_within_half_a_second(model: str) -> None:
    class Ended(Exception):
        pass

    with puck(model) as hardware:
        looks = 0

        last = 0.0

        def guard() -> None:
            nonlocal looks, last
            looks, last = looks + 1, hardware.robot.clock()
            if looks > 40:
                raise Ended

        driver = Driver(hardware.robot, guard=guard)
        driver.start()
        with pytest.raises(Ended):
            driver.leg(0.4, 0.0)
        ended = hardware.robot.clock()
        there = pose(hardware)
        hardware.robot.wait(0.5)
        assert not_none(hardware.bench).truth().speed == (0.0, 0.0)
        assert there.x > 0.005
        assert pose(hardware).x == pytest.approx(there.x, abs=0.003)
        assert ended - last < 0.5


@MODELS
@pytest.mark.parametrize("alone", [None, 0.36])
@pytest.mark.parametrize("share", [0.2, 0.4, 0.6, 0.8, 0.95])
def test_a_computer_that_is_held_up_makes_no_collision(
    model: str, alone: float | None, share: float
) -> None:
    def driven(held_at: int) -> tuple[int, float]:
        """Drive a command; returns how many looks it took, and how far it led."""
        looks = 0

        def guard() -> None:
            nonlocal looks
            looks += 1
            if looks == held_at:
                hardware.robot.port.emulator.advance(hardware.robot.clock() + 0.5)

        with puck(model, baud=115_200) as hardware:
            driver = Driver(hardware.robot, guard=guard, alone=alone)
            driver.start()
            assert not driver.execute(STRAIGHT).collided
            return looks, pose(hardware).x

    looks, _ = driven(0)
    assert driven(int(share * looks))[1] == pytest.approx(STRAIGHT.way, abs=0.0005)


@pytest.mark.parametrize("model", ["epuck2", WIFI])
def test_a_closed_client_leaves_a_standing_robot(model: str) -> None:
    with puck(model) as hardware:
        port = hardware.robot.port
        hardware.robot.set_speed(8, 8)
        left, right = port.emulator.robot.motors
        assert left.speed == right.speed > 0
        hardware.robot.close()
        assert left.speed == right.speed == 0


@pytest.mark.parametrize(
    "kind", [RobotKind.AUTO, pytest.param(RobotKind.EPUCK, marks=pytest.mark.long)]
)
def test_it_is_found_on_a_terminal(kind: RobotKind) -> None:
    with (
        emulator("--no-zenoh", "--baud", "unpaced", "--model", "epuck2") as process,
        robot_of(process.path, 115_200, kind) as robot,
    ):
        assert isinstance(robot, Epuck)
        assert robot.connect() == ("Version 2.0 January 2018 GCtronic",)


def test_it_is_driven_on_wifi() -> None:
    options = ("--no-zenoh", "--model", "epuck2", "--profile", "wifi", "--tcp", "127.0.0.1:0")
    with emulator(*options) as process:
        address = process.announcement.rpartition("/")[2]
        with robot_of(f"epuck2://{address}") as robot:
            assert isinstance(robot, WifiEpuck)
            robot.set_speed(5, 5)
            while robot.counters()[0] < 20:
                robot.wait(0.01)
            robot.stop()
            assert robot.battery() == pytest.approx(3.9, abs=0.01)


def test_an_address_on_wifi_is_the_robots_port() -> None:
    found = [PortAddress.parse(f"epuck2://{host}").url for host in ("10.0.0.7", "robot:1001/")]
    assert found == ["socket://10.0.0.7:1000", "socket://robot:1001"]


def test_batteries_are_volts() -> None:
    found = {}
    for model in ("epuck", "epuck&profile=btcom", "epuck&firmware=first-revision", "epuck2"):
        with puck(model) as hardware:
            hardware.robot.connect()
            found[model] = hardware.robot.battery()
    assert found["epuck"] == pytest.approx(3.906, abs=0.001)
    assert found["epuck2"] == pytest.approx(3.9, abs=0.001)
    assert list(found.values())[1:3] == [None, None]


def test_a_khepera_is_a_khepera() -> None:
    with robot_of("khepera://open-box") as robot:
        assert isinstance(robot, Khepera)
    with pytest.raises(RobotError), robot_of("khepera://open-box", kind=RobotKind.EPUCK):
        raise AssertionError("a Khepera was taken for an e-puck")


class TestServo:
    @pytest.mark.parametrize("period", [0.003, 0.02, 0.05])
    @pytest.mark.parametrize("way", [163.0, -40.0, 5.0, 3000.0])
    def test_comes_to_its_target_whenever_it_looks(self, period: float, way: float) -> None:
        servo = Servo(target=way, top=900.0, acceleration=1550.0)
        place = speed = farthest = 0.0
        for _ in range(5000):
            if servo.reached(place):
                break
            place += speed * period
            speed = servo.steer(round(place), period)
            farthest = max(farthest, place * (1 if way > 0 else -1))
        assert servo.reached(place)
        assert farthest <= abs(way) + 2

    def test_speeds_up_no_faster_than_it_may(self) -> None:
        servo = Servo(target=1000.0, top=900.0, acceleration=1000.0)
        assert servo.steer(0.0, 0.1) == pytest.approx(100.0)
        assert servo.steer(10.0, 0.1) == pytest.approx(200.0)

    def test_a_wheel_that_still_creeps_is_not_there(self) -> None:
        servo = Servo(target=100.0, top=400.0, acceleration=4_000.0)
        assert servo.steer(97.0, 0.03) > 0.0
        assert not servo.reached(99.0)
        assert servo.steer(99.0, 0.03) == 0.0
        assert servo.reached(99.0)
