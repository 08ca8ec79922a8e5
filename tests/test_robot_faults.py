"""Faults of the robot itself: what each changes, when, and that everything else stays as it is."""

from collections.abc import Iterator
from math import degrees

import numpy as np
import pytest
from khepera_protocol.zenoh.payloads import Pose, Reset

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.fault import FAULTS, Happening
from khepera_emulator.line.fault_text import parse_fault
from khepera_emulator.robot.emulator import Emulator
from khepera_emulator.robot.options import UrlOptions

KINDS = [name for name in FAULTS.names() if name.rpartition("-")[0]]
BEFORE_A_WALL = Pose(x=0.465, y=0.0, heading=0.0)
IN_THE_OPEN = Pose(x=0.0, y=0.0, heading=0.0)


class Tried:
    """A robot in the open box, with faults, and how to ask it."""

    def __init__(self, *faults: str, drift: str = "none", seed: int = 1) -> None:
        query = "&".join([f"seed={seed}&drift={drift}", *(f"fault={each}" for each in faults)])
        options = UrlOptions.from_url(f"khepera://open-box?{query}")
        self.emulator = Emulator(options.setup())
        self.told: list[Happening] = []
        self.emulator.uart.faults.listeners.append(self.told.append)

    def ask(self, request: str) -> str:
        self.emulator.read()
        self.emulator.write(request.encode() + b"\r")
        self.wait(0.1)
        return self.emulator.read().decode().strip()

    def counts(self, request: str) -> list[int]:
        return [int(word) for word in self.ask(request).split(",")[1:]]

    def wait(self, seconds: float) -> None:
        self.emulator.advance(self.emulator.now + seconds)

    def put(self, pose: Pose) -> None:
        self.emulator.reset(Reset(pose=pose))
        self.wait(0.1)

    @property
    def pose(self) -> Pose:
        return self.emulator.truth().pose


@pytest.fixture
def tried() -> Iterator[list[Tried]]:
    made: list[Tried] = []
    yield made
    for each in made:
        each.emulator.close()


@pytest.fixture
def well(tried: list[Tried]) -> Tried:
    tried.append(Tried())
    return tried[-1]


def ailing(tried: list[Tried], *faults: str, drift: str = "none", seed: int = 1) -> Tried:
    tried.append(Tried(*faults, drift=drift, seed=seed))
    return tried[-1]


def test_a_dead_sensor_sees_nothing(tried: list[Tried]) -> None:
    ill = ailing(tried, "dead-sensor:sensor=2")
    ill.put(BEFORE_A_WALL)
    counts = ill.counts("N")
    assert counts[2] == 0
    assert counts[3] > 500
    assert ill.counts("O")[2] == ill.emulator.robot.model.dark


def test_all_sensors_are_dead_when_none_is_named(tried: list[Tried]) -> None:
    ill = ailing(tried, "dead-sensor")
    ill.put(BEFORE_A_WALL)
    assert ill.counts("N") == [0] * 8


def test_a_stuck_sensor_reads_what_it_read_first(tried: list[Tried]) -> None:
    ill = ailing(tried, "stuck-sensor:sensor=2,at=1")
    ill.put(BEFORE_A_WALL)
    ill.wait(1.0)
    near = ill.counts("N")
    ill.put(IN_THE_OPEN)
    far = ill.counts("N")
    assert far[2] == near[2] > 500
    assert far[3] < 50


def test_a_dirty_sensor_reads_a_part(tried: list[Tried], well: Tried) -> None:
    ill = ailing(tried, "dirty-sensor:sensor=2,part=0.25")
    for each in (ill, well):
        each.put(BEFORE_A_WALL)
    counts, clean = ill.counts("N"), well.counts("N")
    assert counts[2] == round(0.25 * clean[2])
    assert counts[3] == clean[3]


def speeds(robot: Tried, seconds: float = 1.0) -> list[int]:
    robot.put(IN_THE_OPEN)
    robot.ask("D,10,10")
    robot.wait(seconds)
    return robot.counts("E")


def test_a_weak_motor_comes_to_a_part_of_its_speed(tried: list[Tried]) -> None:
    ill = ailing(tried, "weak-motor:wheel=left,part=0.05")
    left, right = speeds(ill)
    assert 0 < left < 8
    assert right == 10


def test_a_jammed_motor_stands_and_its_encoder_with_it(tried: list[Tried]) -> None:
    ill = ailing(tried, "jammed-motor:wheel=right,at=2,for=3")
    assert speeds(ill) == [10, 10]
    ill.wait(1.0)
    before = ill.counts("H")
    assert ill.counts("E") == [10, 0]
    after = ill.counts("H")
    assert after[1] == before[1]
    assert after[0] > before[0]
    ill.wait(3.0)
    assert ill.counts("E") == [10, 10]


def test_a_worn_wheel_goes_less_than_it_counts(tried: list[Tried], well: Tried) -> None:
    ill = ailing(tried, "worn-wheel:wheel=left,part=0.9")
    for each in (ill, well):
        each.put(IN_THE_OPEN)
        each.ask("C,1000,1000")
        each.wait(4.0)
    assert ill.counts("H") == well.counts("H") == [1000, 1000]
    # the way of the left wheel is 8 mm shorter: over a base of 53 mm
    assert degrees(ill.pose.heading) == pytest.approx(degrees(0.1 * 0.08 / 0.053), rel=0.01)
    assert well.pose.heading == pytest.approx(0.0, abs=1e-6)


def test_an_empty_battery_falls_until_the_robot_starts_again(tried: list[Tried]) -> None:
    ill = ailing(tried, "empty-battery:at=1,for=4")
    ill.ask("D,10,10")
    full = ill.counts("I,0")[0]
    ill.wait(2.8)
    assert ill.counts("I,0")[0] == pytest.approx(0.8 * full, abs=0.02 * full)
    ill.wait(2.0)
    assert "ROM of minirobot" in ill.emulator.read().decode()
    assert ill.counts("E") == [0, 0]
    assert ill.counts("I,0") == [full]
    assert [(told.time, told.what) for told in ill.told] == [
        (1.0, "4 s"),
        (5.0, "the robot starts again"),
    ]


def test_a_frozen_camera_gives_the_first_picture(tried: list[Tried]) -> None:
    ill = ailing(tried, "frozen-camera:at=1,for=2")
    emulator = ill.emulator
    ill.wait(1.0)
    first, wide = emulator.mirror_image(), emulator.panorama()
    ill.put(BEFORE_A_WALL)
    assert (emulator.mirror_image() == first).all()
    assert (emulator.panorama() == wide).all()
    ill.wait(2.0)
    assert (emulator.mirror_image() != first).any()


def test_a_dark_camera_gets_a_part_of_the_light(tried: list[Tried], well: Tried) -> None:
    ill = ailing(tried, "dark-camera:part=0.5")
    dark, light = ill.emulator.panorama(), well.emulator.panorama()
    assert np.abs(dark - light * 0.5).max() <= 1


@pytest.mark.parametrize("angle", [90, -90])
def test_a_turned_camera_looks_aside(tried: list[Tried], angle: int) -> None:
    ill = ailing(tried, f"turned-camera:angle={angle}")
    panorama = ill.emulator.panorama().astype(float)
    red = (panorama[:, :, 2] - panorama[:, :, :2].max(axis=2)).max(axis=0)
    # the red wall is ahead, in the middle column of 240; a camera turned left has it at its right
    assert red[120 + angle * 240 // 360] > 60
    assert red[120 - angle * 240 // 360] < 30


def test_ground_truth_names_what_lasts(tried: list[Tried], well: Tried) -> None:
    ill = ailing(tried, "dead-sensor:at=1,for=1", "dark-camera")
    assert ill.emulator.truth().faults == ("dark-camera",)
    ill.wait(1.5)
    assert ill.emulator.truth().faults == ("dead-sensor", "dark-camera")
    ill.wait(1.0)
    assert ill.emulator.truth().faults == ("dark-camera",)
    assert well.emulator.truth().faults == ()


def test_chance_is_the_seeds(tried: list[Tried]) -> None:
    def begins(seed: int) -> list[float]:
        ill = ailing(tried, "dead-sensor:p=0.2,for=0.5,n=4", seed=seed)
        for _ in range(40):
            ill.ask("N")
        return [told.time for told in ill.told]

    assert begins(1) == begins(1) != begins(2)
    assert len(begins(1)) == 4


@pytest.mark.parametrize("kind", KINDS)
def test_before_its_time_nothing_is_changed(tried: list[Tried], well: Tried, kind: str) -> None:
    ill = ailing(tried, f"{kind}:at=60,for=1", drift="none")
    for each in (ill, well):
        each.ask("D,8,9")
        each.wait(1.0)
    for request in ("H", "E", "N", "I,0"):
        assert ill.ask(request) == well.ask(request)
    assert ill.pose == well.pose
    assert (ill.emulator.mirror_image() == well.emulator.mirror_image()).all()


def test_a_reset_with_a_seed_begins_their_time_anew(tried: list[Tried]) -> None:
    ill = ailing(tried, "dead-sensor:at=1,for=1")
    ill.wait(1.5)
    assert ill.emulator.truth().faults == ("dead-sensor",)
    ill.emulator.reset(Reset(seed=3))
    assert ill.emulator.truth().faults == ()
    ill.wait(1.5)
    assert ill.emulator.truth().faults == ("dead-sensor",)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("dead-sensor:sensor=8", "sensor=8 is none: give 0 to 7"),
        ("weak-motor:wheel=front", "wheel is left, right or both"),
        ("weak-motor:part=2", "part=2 is out of range"),
        ("turned-camera:angle=-181", "angle=181 is out of range"),
        ("turned-camera:angle=--1", "angle=-1 is out of range"),
        ("dark-camera:sensor=1", "dark-camera knows p, n, at, for, part, not 'sensor'"),
        ("empty-battery:p=1", "empty-battery knows at, for, not 'p'"),
    ],
)
def test_a_wrong_one_is_told(text: str, why: str) -> None:
    with pytest.raises(EmulatorError) as caught:
        parse_fault(text)
    assert why in str(caught.value)
