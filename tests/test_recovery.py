"""Waiting for robot and camera to work again, on clocks that nothing is slept on."""

from math import inf
from typing import Any

import pytest

import macor_hil.runs.recovery
from macor_hil.errors import CameraLostError, LinkError, MacorError, RobotError, WrongPortError
from macor_hil.runs.recovery import (
    TrainingRecovery,
    longer_and_longer,
    pause,
    wait_for,
    wait_until_both_work,
)


class Clock:
    """The time of a robot or of this machine, which passes when somebody waits."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


class Device:
    """A robot or a camera that fails so many times, or for ever, and counts how often it is asked.

    Args:
        failures: times that it fails.
        error: what it fails with.
    """

    def __init__(self, failures: float, error: MacorError) -> None:
        self.left, self.error = failures, error
        self.asked = 0
        self.time = Clock()
        self.clock, self.wait = self.time.monotonic, self.time.sleep

    def work(self, *_: object) -> str:
        self.asked += 1
        self.left -= 1
        if self.left >= 0:
            raise self.error
        return "works"

    recover = grab = work


def a_robot(failures: float = 0) -> Any:
    return Device(failures, LinkError("no adapter"))


def a_camera(failures: float = 0, *, worked: bool = True) -> Any:
    camera: Any = Device(failures, CameraLostError("a loose contact"))
    camera.worked = worked
    return camera


def nothing() -> None:
    """The program is to go on."""


class EndedAt:
    """A check that ends the program when it is made for the n-th time."""

    def __init__(self, number: int) -> None:
        self.left = number

    def __call__(self) -> None:
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """This machine's time."""
    clock = Clock()
    monkeypatch.setattr(macor_hil.runs.recovery, "time", clock)
    return clock


# robot and camera that were there


def test_the_robot_is_got_back_first_and_then_the_camera() -> None:
    robot, camera = a_robot(3), a_camera(2)
    wait_until_both_work(robot, camera, 30.0)
    assert (robot.asked, camera.asked) == (4, 3)
    assert robot.time.now == pytest.approx(101.0)  # five pauses of 0.2 s, on the robot's clock


@pytest.mark.parametrize(
    ("robot", "camera", "error"),
    [(a_robot(inf), a_camera(), LinkError), (a_robot(), a_camera(inf), CameraLostError)],
)
def test_what_does_not_come_back_in_time_is_an_error(
    robot: Any, camera: Any, error: type[MacorError]
) -> None:
    with pytest.raises(error):
        wait_until_both_work(robot, camera, 10.0)
    assert robot.time.now == pytest.approx(110.0, abs=0.21)


def test_without_patience_each_is_tried_once() -> None:
    robot, camera = a_robot(), a_camera()
    wait_until_both_work(robot, camera, 0.0)
    assert (robot.asked, camera.asked) == (1, 1)


def test_a_port_that_never_will_be_is_an_error_at_once() -> None:
    robot: Any = Device(inf, WrongPortError("no such arena"))
    with pytest.raises(WrongPortError):
        wait_until_both_work(robot, a_camera(worked=False), 30.0)
    assert robot.asked == 1


@pytest.mark.parametrize("check", [1, 3, 8])
def test_the_end_of_the_program_ends_the_waiting(check: int) -> None:
    with pytest.raises(KeyboardInterrupt):
        wait_until_both_work(a_robot(4), a_camera(inf), inf, EndedAt(check))


# devices that are not there yet


def test_a_device_that_comes_is_returned_and_told_of_once(clock: Clock) -> None:
    told: list[str] = []
    assert wait_for(a_robot(50).work, inf, nothing, told.append) == "works"
    assert told == ["no adapter"]
    assert clock.now == pytest.approx(110.0)


def test_a_device_that_does_not_come_in_time_is_an_error(clock: Clock) -> None:
    with pytest.raises(LinkError, match="no adapter"):
        wait_for(a_robot(inf).work, 5.0, nothing, lambda _: None)
    assert clock.now == pytest.approx(105.0, abs=0.21)


def test_a_device_that_never_will_fit_is_an_error_at_once(clock: Clock) -> None:
    with pytest.raises(WrongPortError):
        wait_for(Device(inf, WrongPortError("no such arena")).work, inf, nothing, lambda _: None)
    assert clock.now == 100.0


@pytest.mark.usefixtures("clock")
def test_the_end_of_the_program_ends_the_waiting_for_a_device() -> None:
    device = a_robot(inf)
    with pytest.raises(KeyboardInterrupt):
        wait_for(device.work, inf, EndedAt(4), lambda _: None)
    assert device.asked == 3


# pauses


def test_a_pause_takes_its_time_and_ends_with_the_program(clock: Clock) -> None:
    pause(30.0, nothing)
    assert clock.now == pytest.approx(130.0, abs=0.21)
    with pytest.raises(KeyboardInterrupt):
        pause(inf, EndedAt(10))


def test_attempts_become_rarer_to_a_limit_however_many_there_are() -> None:
    assert [longer_and_longer(k) for k in range(1, 7)] == [2.0, 4.0, 8.0, 16.0, 30.0, 30.0]
    assert longer_and_longer(1_000_000) == 30.0  # a year of them


# trainings


def test_a_training_goes_on_by_itself() -> None:
    robot, asked = a_robot(20), list[str]()
    TrainingRecovery(robot, a_camera(3), asked.append).recover(LinkError("no adapter"))
    assert robot.asked == 21
    assert not asked


def test_a_training_asks_an_operator_for_what_does_not_go_away() -> None:
    robot, asked = a_robot(inf), list[str]()

    def help_it(what: str) -> None:
        asked.append(what)
        robot.left = 0 if len(asked) == 2 else inf

    TrainingRecovery(robot, a_camera(), help_it, patience=5.0).recover(LinkError("it fell"))
    assert asked == ["it fell. It did not go away by itself: no adapter"] * 2


def test_without_an_operator_it_is_an_error() -> None:
    alone = TrainingRecovery(a_robot(inf), a_camera(), patience=5.0)
    with pytest.raises(LinkError, match="no adapter"):
        alone.recover(LinkError("it fell"))
    with pytest.raises(RobotError, match="put it on free floor"):
        alone.free()


def test_a_camera_that_never_worked_is_not_waited_for() -> None:
    robot, lost = a_robot(), CameraLostError("no device")
    with pytest.raises(CameraLostError, match="no device"):
        TrainingRecovery(robot, a_camera(worked=False)).recover(lost)
    assert robot.asked == 0
