"""No way out of a drive leaves the wheels turning: the driver's own promise."""

import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from math import hypot, pi
from typing import Any

import pytest
from as_type import not_none
from khepera_protocol.serial.units import PULSE
from khepera_protocol.zenoh.payloads import Truth

from macor_hil.commands import STRAIGHT
from macor_hil.errors import RobotError
from macor_hil.hardware.devices import Hardware, open_hardware
from macor_hil.hardware.driver import LEASH, Driver, DriveSettings

PORT = "khepera://open-box?seed=1&drift=none"
STANDING = 0.004


class Defect(Exception):
    pass


class Drive:
    """A driver on an emulated robot whose guard fails once the wheels turn."""

    def __init__(self, hardware: Hardware, failure: Callable[..., Any] | None) -> None:
        self.emulator = hardware.robot.port.emulator
        self._failure = failure
        self.failed = 0
        self.driver = Driver(hardware.robot, guard=self._guard)
        self.driver.start()

    def speed(self) -> float:
        truth: Truth = self.emulator.truth()
        return max(map(abs, truth.speed))

    def stands(self, settling: float = 0.1) -> bool:
        """Return whether it is at rest once its controllers have settled, before a command ends."""
        self.emulator.advance(self.emulator.now + settling)
        return self.speed() < STANDING

    def _guard(self) -> None:
        if self._failure and self.speed() > 0.05:
            self.failed += 1
            self._failure()


def defect() -> None:
    raise Defect


def impatient() -> None:
    """Ctrl-C, and again while the robot is being stopped."""
    signal.raise_signal(signal.SIGINT)


@pytest.fixture
def hardware() -> Iterator[Hardware]:
    with open_hardware(PORT, baud=38400) as hardware:
        yield hardware


WAYS = {
    "a command": lambda driver: driver.execute(STRAIGHT),
    "a way back": lambda driver: driver.back_off(1),
    "a turn": lambda driver: driver.turn(3.0),
    "a leg": lambda driver: driver.leg(5.0, 0.0),
    "a speed": lambda driver: driver.hold(10, 10, 2.0),
}


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS.keys())
@pytest.mark.parametrize(("failure", "kind"), [(defect, Defect), (impatient, KeyboardInterrupt)])
def test_what_is_raised_in_mid_drive_finds_a_robot_that_stands(
    hardware: Hardware, way: Callable[..., Any], failure: Callable[..., Any], kind: type[Defect]
) -> None:
    drive = Drive(hardware, None)
    drive.driver.execute(STRAIGHT)
    drive._failure = failure
    with pytest.raises(kind):
        way(drive.driver)
    assert drive.failed == 1
    assert drive.stands()


def test_a_leg_is_driven_to_its_end_and_its_target_is_never_far_ahead(hardware: Hardware) -> None:
    drive = Drive(hardware, None)
    ahead = []
    drive.driver._guard = lambda: ahead.append(max(abs(w.error) for w in hardware.robot.status()))
    begin = not_none(hardware.bench).truth().pose
    outcome = drive.driver.leg(0.4, 0.0)
    assert not outcome.collided
    end = not_none(hardware.bench).truth().pose
    assert hypot(end.x - begin.x, end.y - begin.y) == pytest.approx(0.4, abs=0.001)
    assert max(ahead) * PULSE <= LEASH + 0.001
    assert drive.driver.leg(0.0, 4 * pi).counters == pytest.approx(
        [c + o for c, o in zip(outcome.counters, (-4163, 4163), strict=True)], abs=3
    )
    assert drive.stands()


def test_a_leg_ends_at_a_wall(hardware: Hardware) -> None:
    drive = Drive(hardware, None)
    assert drive.driver.leg(5.0, 0.0).collided
    assert drive.stands(0.3)


def test_a_speed_is_held_for_its_time_only(hardware: Hardware) -> None:
    drive = Drive(hardware, None)
    begin = hardware.robot.clock()
    outcome = drive.driver.hold(10, 10, 0.4)
    assert 0.4 <= hardware.robot.clock() - begin < 0.5
    assert not outcome.collided
    assert outcome.counters[0] == pytest.approx(10 * 40, rel=0.15)
    assert drive.stands(0.3)


def test_a_speed_may_be_held_on_where_no_time_passes_between_two_calls(hardware: Hardware) -> None:
    drive = Drive(hardware, None)
    drive.driver.hold(10, 10, 0.4, roll_on=True)
    assert drive.speed() > 0.05


def test_a_speed_ends_with_a_collision_even_where_it_may_be_held_on(hardware: Hardware) -> None:
    drive = Drive(hardware, None)
    assert drive.driver.hold(40, 40, 20.0, roll_on=True).collided
    assert drive.stands()


def test_no_speed_is_above_the_greatest_one(hardware: Hardware) -> None:
    drive = Drive(hardware, None)
    drive.driver.hold(127, -127, 0.4, roll_on=True)
    assert drive.speed() == pytest.approx(20 * 0.008, rel=0.1)


def test_a_stop_that_was_not_confirmed_is_told_with_what_came_first(
    hardware: Hardware, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive = Drive(hardware, defect)

    def dead(*_: object) -> None:
        raise RobotError("the line is dead")

    monkeypatch.setattr(hardware.robot, "halt", dead)
    with pytest.raises(RobotError, match=r"line is dead; the robot has NOT confirmed.*21 mm"):
        drive.driver.execute(STRAIGHT)


@pytest.mark.parametrize("speed", [2, 20])
@pytest.mark.parametrize("baud", [9600, 57600])
@pytest.mark.parametrize("way", ["a command", "a way back", "a turn"])
def test_a_robot_that_is_left_alone_stands_soon_where_that_was_asked_for(
    monkeypatch: pytest.MonkeyPatch, speed: int, baud: int, way: str
) -> None:
    """As after SIGKILL: at any look, with nobody left to stop it."""
    with open_hardware(PORT, baud=baud) as hardware:
        drive = Drive(hardware, None)
        settings = DriveSettings(speed=speed)
        driver = Driver(hardware.robot, settings, lambda: drive._guard(), alone=0.36)
        driver.start()
        whole = driver.execute(STRAIGHT)
        assert not whole.collided
        assert whole.counters == pytest.approx([STRAIGHT.way / PULSE] * 2, abs=3)
        monkeypatch.setattr(hardware.robot, "halt", lambda: None)
        fastest = 0.0
        for looks in range(1, 12, 2):
            left = iter(range(looks))

            def leave(left: Iterator[int] = left) -> None:
                if next(left, None) is None:
                    raise Defect

            drive._guard = leave  # type: ignore[method-assign]
            with suppress(Defect):
                WAYS[way](driver)
            fastest = max(fastest, drive.speed())
            drive.stands(0.5)
            assert drive.speed() < STANDING
            drive._guard = lambda: None  # type: ignore[method-assign]
            driver.start()
            driver.execute(STRAIGHT)
        assert fastest > 0.01


@pytest.mark.parametrize("baud", [1200, 9600])
@pytest.mark.parametrize("alone", [None, 0.36])
def test_a_blocked_wheel_is_a_collision_within_seconds_on_any_line(
    baud: int, alone: float | None
) -> None:
    with open_hardware(f"{PORT}&fault=jammed-motor", baud=baud) as hardware:
        driver = Driver(hardware.robot, alone=alone)
        driver.start()
        begun = hardware.robot.clock()
        assert driver.execute(STRAIGHT).collided
        assert hardware.robot.clock() - begun < (5.0 if baud == 1200 else 1.5)
