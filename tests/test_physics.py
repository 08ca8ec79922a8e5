"""Motion by the emulator's own arithmetic against rigid bodies all the time (`--physics`)."""

from math import degrees
from typing import Any

import pytest
from in_process import open_robot

pytestmark = pytest.mark.pybullet
physics = pytest.importorskip("physics", exc_type=ImportError)

BOUNDS = {
    "1 m straight ahead": (0.002, 0.5),
    "an arc": (0.002, 1.0),
    "two turns on the spot": (0.001, 2.0),
    "a start, a curve, a turn, a stop": (0.004, 4.0),
    "against a wall, head on": (0.001, 0.5),
    "against a wall at 30 degrees": (0.010, 12.0),
    "against a wall at 60 degrees": (0.010, 15.0),
    "a box pushed": (0.002, 2.0),
}
"""Metres and degrees that both may be apart, at any time of a course; docs/physics.md measures."""


def test_every_course_has_bounds() -> None:
    assert [course.name for course in physics.COURSES] == list(BOUNDS)


@pytest.mark.parametrize("course", physics.COURSES, ids=lambda course: course.name)
def test_both_ways_of_moving_agree(course: Any) -> None:
    own, rigid = (physics.drive(course, rigid=each) for each in (False, True))
    gap, turn = physics.apart(own, rigid)
    most, most_turned = BOUNDS[course.name]
    assert gap < most
    assert degrees(turn) < most_turned
    # they are two, and not one compared with itself
    assert gap > 0.0


def test_a_robot_is_a_rigid_body_where_nothing_can_be_pushed() -> None:
    for text, rigid in (("auto", False), ("pybullet", True)):
        with open_robot(f"khepera://corridor?physics={text}", timeout=1) as port:
            chassis = port.emulator.robot.chassis
            assert (chassis.rigid is not None) == rigid
            port.write(b"D,5,5\n")
            assert port.readline() == b"d\r\n"
            port.emulator.advance(0.5)
            assert chassis._dynamic == rigid
            port.write(b"D,0,0\n")
            port.emulator.advance(2.0)
            pose = port.emulator.truth().pose
            port.emulator.advance(3.0)
            assert port.emulator.truth().pose == pose
