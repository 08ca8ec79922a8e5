"""The Khepera from outside."""

from typing import Final

from khepera_protocol.serial.commands import SENSOR_BEARINGS, SENSORS
from khepera_protocol.serial.units import BODY_RADIUS, PULSE, WHEEL_BASE

from macor_hil.hardware.robots.form import Form
from macor_hil.hardware.robots.khepera.listener import KheperaListener

_RESPONSE: Final = (
    *((3, 43), (12, 41), (26, 39), (30, 37), (55, 35), (97, 33), (161, 31), (233, 29)),
    *((271, 27), (449, 25), (631, 23), (782, 21), (914, 19), (993, 17), (1023, 15)),
)
"""Counts, and millimetres: the mean of the eight sensors of one Khepera (S. Nolfi's samples, the
median within 6 degrees of each sensor's axis); sensors differ by 5 mm and more."""

KHEPERA: Final = Form(
    title="Khepera",
    radius=BODY_RADIUS,
    height=0.03,
    sensors=SENSORS,
    bearings=SENSOR_BEARINGS,
    sensor_height=0.012,
    response=tuple((count, gap / 1000) for count, gap in _RESPONSE),
    field_of_view=0.52,  # samples as above: 30 degrees
    pulse=PULSE,
    base=WHEEL_BASE,
    chemistry="NICD",
    cells=4,
    listener=KheperaListener,
)
