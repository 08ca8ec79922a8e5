"""The longest drive that is possible: against exhaustive search, and driven."""

from itertools import product
from math import ceil, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from as_type import not_none
from hypothesis import given, settings
from hypothesis import strategies as st
from khepera_protocol.serial.units import PULSE, WHEEL_BASE
from khepera_protocol.zenoh.payloads import Outline, Pose, Reset, WheelDrift
from worlds import arena

from khepera_emulator.arenas.arena import Arena, load_arena
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import KHEPERA, KHEPERA2, Model
from khepera_emulator.robot.epuck.models import EPUCK2
from khepera_emulator.routes.oracle import MARGIN, PAPER_COMMANDS, Oracle
from khepera_emulator.senses.infrared import Infrared
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.free_space import pose_of, random_pose
from khepera_emulator.world.outline import outline
from macor_hil.commands import COMMANDS
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver, DriveSettings
from macor_hil.hardware.odometry import Wheels, integrate

LEFT, RIGHT, STRAIGHT = range(3)
COLLISION = DriveSettings().collision

TIGHT = arena(
    wall=[
        {"points": [[0.0, 0.0], [0.24, 0.0], [0.24, 0.2], [0.0, 0.2], [0.0, 0.0]]},
        {"points": [[0.24, 0.08], [0.17, 0.1]]},
    ],
    cylinder=[{"centre": [0.05, 0.05], "radius": 0.012}],
)
"""A room that no drive lasts long in."""


def oracle(made: Arena, model: Model = KHEPERA, **options: Any) -> Oracle:
    return Oracle(outline(made, model), **options)


def places(made: Arena, count: int, seed: int = 0) -> list[Pose]:
    gap = FloorPlan(made).clearance
    rng = np.random.default_rng(seed)
    return [
        random_pose(made.free, lambda pose: gap(pose.x, pose.y) - KHEPERA.radius, rng)
        for _ in range(count)
    ]


class Exhaustive:
    """Every sequence of commands, one pose after the other, by the emulator's own sensors."""

    def __init__(self, made: Arena, margin: float = MARGIN) -> None:
        self.plan = FloorPlan(made)
        self.infrared = Infrared(KHEPERA, self.plan, [], np.random.default_rng(0))
        self.margin = margin

    def collides(self, pose: Pose) -> bool:
        if self.plan.clearance(pose.x, pose.y) <= KHEPERA.radius + self.margin:
            return True
        gaps = self.infrared.gaps(pose.x, pose.y, pose.heading)[:6]
        return any(
            self.infrared.response(sensor, gap - self.margin) >= COLLISION
            for sensor, gap in enumerate(gaps)
        )

    def after(self, pose: Pose, ways: tuple[float, float]) -> Pose | None:
        """The pose after a command; None: it collides on the way."""
        count = ceil(max(ways) / 0.0055)
        for k in range(1, count + 1):
            left, right = (way / PULSE * k / count for way in ways)
            there = integrate(pose, (0, 0), (left, right))
            if self.collides(there):
                return None
        return there

    def longest(self, pose: Pose, commands: int) -> int:
        """Length of the longest drive, a layer of poses at a time, none left out."""
        layer = [] if self.collides(pose) else [pose]
        length = 0
        while layer and length < commands:
            tried = [self.after(here, ways) for here in layer for ways in PAPER_COMMANDS]
            layer = [there for there in tried if there is not None]
            length += bool(layer)
        return length


def test_its_commands_are_those_of_the_controller() -> None:
    wheels = Wheels()
    counts = [wheels.counts(command.way, command.turn) for command in COMMANDS]
    assert [(round(left) * PULSE, round(right) * PULSE) for left, right in counts] == list(
        PAPER_COMMANDS
    )


@settings(max_examples=25)
@given(
    x=st.floats(0.05, 0.2), y=st.floats(0.05, 0.16), heading=st.floats(-3.2, 3.2), asked=st.just(7)
)
def test_it_agrees_with_exhaustive_search(x: float, y: float, heading: float, asked: int) -> None:
    pose = Pose(x=x, y=y, heading=heading)
    found = oracle(TIGHT).longest_drive(pose, asked)
    assert found.exact
    assert found.length == Exhaustive(TIGHT).longest(pose, asked)


@pytest.mark.parametrize("name", ["maze", "corridor"])
def test_it_agrees_with_exhaustive_search_where_the_robot_drives(name: str) -> None:
    made = load_arena(name)
    made_oracle, search = oracle(made), Exhaustive(made)
    lengths = set()
    for pose in places(made, 10):
        found = made_oracle.longest_drive(pose, 5)
        assert found.exact
        assert found.length == search.longest(pose, 5)
        lengths.add(found.length)
    assert len(lengths) > 1 or name == "corridor"


@settings(max_examples=25)
@given(x=st.floats(0.05, 0.2), y=st.floats(0.05, 0.16), heading=st.floats(-3.2, 3.2))
def test_the_drive_that_it_tells_is_one(x: float, y: float, heading: float) -> None:
    search, pose = Exhaustive(TIGHT), Pose(x=x, y=y, heading=heading)
    found = oracle(TIGHT).longest_drive(pose, 40)
    for command in found.commands:
        pose = not_none(search.after(pose, PAPER_COMMANDS[command]))


def test_narrow_layers_find_true_drives_and_say_that_longer_ones_may_be_there() -> None:
    made = load_arena("corridor")
    made_oracle, search = oracle(made), Exhaustive(made)
    for start in places(made, 10, seed=3):
        few, many = (made_oracle.longest_drive(start, 40, widths) for widths in ((4,), (1024,)))
        assert few.exact == (few.length == 40) or few == many
        assert few.length <= many.length
        pose = start
        for command in few.commands:
            pose = not_none(search.after(pose, PAPER_COMMANDS[command]))


def test_a_whole_circle_is_possible_where_there_is_room() -> None:
    found = oracle(load_arena("open-box")).longest_drive(Pose(x=0.2, y=0.1, heading=1.0), 400)
    assert (found.length, found.exact) == (400, True)


def test_nothing_is_possible_before_a_wall_and_little_in_a_corner() -> None:
    made_oracle = oracle(load_arena("open-box"))
    before = made_oracle.longest_drive(Pose(x=0.455, y=0.0, heading=0.0), 40)
    assert (before.commands, before.exact) == ((), True)
    corner = made_oracle.longest_drive(Pose(x=0.40, y=0.40, heading=radians(45)), 40)
    assert corner.exact
    assert 0 < corner.length < 6


def test_no_command_asked_for_none_found() -> None:
    found = oracle(load_arena("open-box")).longest_drive(Pose(x=0.0, y=0.0, heading=0.0), 0)
    assert (found.length, found.exact) == (0, True)


def test_it_is_asked_with_the_outline_that_travels() -> None:
    made = load_arena("lamp-room")
    drawing = outline(made, KHEPERA)
    received = Outline.model_validate_json(drawing.model_dump_json())
    for pose in places(made, 3):
        assert Oracle(received).longest_drive(pose, 40) == Oracle(drawing).longest_drive(pose, 40)


def test_robots_differ_and_a_robot_that_is_unknown_is_told() -> None:
    # a wall 33 mm behind the middle: the wider robot stands in it
    made = arena(wall=[{"points": [[-0.038, -1.0], [-0.038, 1.0]]}])
    start = Pose(x=0.0, y=0.0, heading=0.0)
    lengths = [oracle(made, model).longest_drive(start, 5).length for model in (KHEPERA, KHEPERA2)]
    assert lengths == [5, 0]
    strange = {"robot_radius": 0.05, "robot_model": ""}
    drawing = outline(made, KHEPERA).model_copy(update=strange)
    with pytest.raises(
        EmulatorError, match=r"'khepera' with a radius of 0.05 m; there are khepera"
    ):
        Oracle(drawing)


def test_a_robot_is_known_by_its_name_and_without_one_by_its_kind_and_size() -> None:
    made = load_arena("maze")
    drawn = outline(made, KHEPERA2), outline(made, EPUCK2)
    assert drawn[0].robot_radius == drawn[1].robot_radius  # its size alone does not tell
    epucks = Oracle(drawn[1], collision=600)
    nameless = Oracle(drawn[1].model_copy(update={"robot_model": ""}), collision=600)
    found = [
        [each.longest_drive(pose, 8).commands for pose in places(made, 8)]
        for each in (epucks, nameless, Oracle(drawn[0]), Oracle(drawn[0], collision=600))
    ]
    assert found[0] == found[1]
    assert found[0] not in found[2:]


def test_a_name_in_an_outline_never_loads_code_of_its_own(tmp_path: Path) -> None:
    trap, seen = tmp_path / "trap.py", tmp_path / "seen"
    trap.write_text(f"open({str(seen)!r}, 'w')")
    drawing = outline(load_arena("maze"), KHEPERA)
    drawing = drawing.model_copy(update={"robot_model": f"{trap}:MODEL"})
    Oracle(drawing)  # by its size
    assert not seen.exists()


def test_things_stand_still_for_it() -> None:
    made = load_arena("toys")
    straight = Oracle(outline(made, KHEPERA), (PAPER_COMMANDS[STRAIGHT],))
    assert straight.longest_drive(pose_of(made.start), 40).length < 12  # the box in the middle


@pytest.mark.parametrize("name", ["corridor", "maze", "lamp-room"])
def test_the_drives_that_it_finds_are_driven_without_a_collision(name: str) -> None:
    with open_hardware(f"khepera://{name}?drift=none") as hardware:
        made_oracle, driver = Oracle(not_none(hardware.bench).outline()), Driver(hardware.robot)
        for seed in range(3):
            start = not_none(hardware.bench).reset(Reset(random=seed > 0, seed=seed)).pose
            found = made_oracle.longest_drive(start, 40)
            driver.start()
            outcomes = [driver.execute(COMMANDS[command]) for command in found.commands]
            assert not any(outcome.collided for outcome in outcomes)
            assert not not_none(hardware.bench).truth().touched


def test_no_drive_is_longer() -> None:
    # a little nearer to the walls than where sensors are saturated: who drives there has collided
    made = load_arena("maze")
    made_oracle = oracle(made, margin=-MARGIN)
    found = [(pose, made_oracle.longest_drive(pose, 3)) for pose in places(made, 40)]
    doomed = [(pose, drive.length) for pose, drive in found if drive.length < 3]
    assert len(doomed) > 3
    with open_hardware("khepera://maze?drift=none") as hardware:
        driver = Driver(hardware.robot)
        for pose, length in doomed[:4]:
            for commands in product(COMMANDS, repeat=length + 1):
                not_none(hardware.bench).reset(Reset(pose=pose))
                driver.start()
                assert any(driver.execute(command).collided for command in commands)


def test_wheels_that_differ_are_accounted_for() -> None:
    port = "khepera://s-curve?seed=3&drift=scale=0.02,base=0.04"
    with open_hardware(port) as hardware:
        drift = not_none(hardware.bench).truth().drift
        assert abs(drift.left_scale - drift.right_scale) > 0.005
        drawing, driver = not_none(hardware.bench).outline(), Driver(hardware.robot)
        collided = []
        for known in (drift, None):
            start = not_none(hardware.bench).reset(Reset(seed=1)).pose
            found = Oracle(drawing, drift=known).longest_drive(start, 40)
            assert found.length == 40
            driver.start()
            collided.append(any(driver.execute(COMMANDS[c]).collided for c in found.commands))
        assert collided == [False, True]


def test_wheels_as_they_should_be_are_no_drift() -> None:
    ideal = WheelDrift(left_scale=1.0, right_scale=1.0, wheel_base=WHEEL_BASE, slip=0.0)
    made = load_arena("maze")
    for pose in places(made, 3):
        drives = [oracle(made, drift=drift).longest_drive(pose, 12) for drift in (None, ideal)]
        assert drives[0] == drives[1]
