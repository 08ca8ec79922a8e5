"""Units of the protocol in SI, and the shape of the e-puck that both ends count with.

Sources disagree by 2.5 % on the wheel (40 or 41 mm across) and by 4 % on the distance between the
wheels (51 to 53 mm): a robot of one's own wants calibration.
"""

from math import pi
from typing import Final

STEPS_A_TURN: Final = 1000
"""Steps of a wheel's turn: 20 steps of the motor, geared down by 50."""

WHEEL_DIAMETER: Final = 0.041
"""Metres (Webots; 0.040 in the vendor's ROS driver)."""

STEP: Final = pi * WHEEL_DIAMETER / STEPS_A_TURN
"""Way of a wheel for one step, in metres: 0.129 mm."""

WHEEL_BASE: Final = 0.053
"""Distance between the wheels' points of contact, in metres (ROS driver; 0.052 in Webots)."""

BODY_RADIUS: Final = 0.035
"""Of the round body, in metres."""

PROXIMITY_FULL: Final = 4095
"""Greatest reading of an infrared sensor."""

BAUD: Final = 115_200
"""Rate of the line, 8 data bits, no parity, 1 stop bit."""

WIFI_PORT: Final = 1000
"""TCP port of an e-puck2 on WiFi."""

ZERO_G: Final = 2048
"""Reading of an accelerometer's axis that feels nothing."""

ONE_G: Final = 800
"""Digits of 1 g on e-pucks with an analogue accelerometer."""

GYRO_DIGITS: Final = 131.0
"""Digits of a degree a second: +-250 degrees a second in 16 bits."""

SENSORS: Final = (
    "front right",
    "front right side",
    "right",
    "back right",
    "back left",
    "left",
    "front left side",
    "front left",
)
"""The eight infrared sensors in reply order: clockwise from the front right, seen from above."""

SENSOR_BEARINGS: Final = (-15.0, -45.0, -90.0, -150.0, 150.0, 90.0, 45.0, 15.0)
"""Their nominal directions, degrees from straight ahead, left positive (firmware's comment)."""


def battery_volts(raw: int) -> float:
    """Return the voltage of the e-puck2's battery, of which 4096 steps are 5 V."""
    return 3.0 * raw / 4096 * (220 + 330) / 330


def battery_share(raw: int) -> int:
    """Return percent of charge as the firmware reckons them: 3.4 V is empty, 4.2 V full."""
    return min(max(int((battery_volts(raw) - 3.4) / 0.8 * 100), 0), 100)
