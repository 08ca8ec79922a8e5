"""The e-puck and the e-puck2 from outside."""

from math import radians
from typing import Final

from khepera_protocol.epuck.units import BODY_RADIUS, STEP, WHEEL_BASE

from macor_hil.hardware.robots.epuck.listener import listener
from macor_hil.hardware.robots.epuck.readings import BEARINGS, NEAR, scaled
from macor_hil.hardware.robots.form import Form

_RESPONSE: Final = (*((67, 70), (104, 60), (120, 50), (158, 40), (235, 30), (384, 20), (600, 15)),)
"""Readings of the robot, and millimetres to a white wall (Webots' table)."""

EPUCK: Final = Form(
    title="e-puck",
    radius=BODY_RADIUS,
    height=0.047,
    sensors=(
        "left 90",
        "left 45",
        "left 15",
        "right 15",
        "right 45",
        "right 90",
        "back right",
        "back left",
    ),
    bearings=BEARINGS,
    sensor_height=0.034,  # the vendor's ROS driver
    response=tuple((scaled(raw), gap / 1000) for raw, gap in _RESPONSE),
    saturated=NEAR,
    field_of_view=radians(15.0),  # the vendor's ROS driver
    pulse=STEP,
    base=WHEEL_BASE,
    chemistry="LIPO",
    cells=1,
    listener=listener,
)
