"""Units of the protocol in SI, and the shape of the Khepera that both ends count with.

Source: Khepera User Manual 5.02, appendix A, as used by independent clients of real robots
(RoadNarrows, kMatlab, Pyro). Clients differ by 4 % on the length of a pulse (0.0800, 0.0820,
0.0833 mm) and by 8 % on the wheel base (50 to 56 mm): a robot of one's own wants calibration.
"""

PULSE = 0.08e-3
"""Way of a wheel for one encoder count, in metres (600 counts a wheel turn)."""

CONTROL_PERIOD = 0.010
"""Seconds between two steps of the motor controllers; speeds are counts a period."""

SPEED_UNIT = PULSE / CONTROL_PERIOD
"""One speed unit (count / 10 ms) in m/s: 8 mm/s."""

ACCELERATION_UNIT = SPEED_UNIT / 256 / CONTROL_PERIOD
"""One acceleration unit ((count / 256) / 10 ms each 10 ms) in m/s2: 3.125 mm/s2."""

WHEEL_BASE = 0.053
"""Nominal distance between the two wheels' points of contact, in metres."""

BODY_RADIUS = 0.0275
"""Of the round body, in metres."""

PROXIMITY_FULL = 1023
"""Greatest reading of an infrared sensor."""

BITS_PER_CHARACTER = 11
"""Start bit, eight data bits, no parity, two stop bits."""

ADC_FULL_SCALE = 4.096
"""Volts that the 10-bit converter reads as 1024 counts."""


def battery_volts(counts: int) -> float:
    """Return the battery's voltage from A/D input 0, which gets half of it.

    That it does is a choice of the emulator's (docs/khepera-choices.md).
    """
    return 2.0 * counts * ADC_FULL_SCALE / 1024


def wire_time(characters: int, baud: int) -> float:
    """Return the seconds of a number of characters on the line at a rate in bits a second."""
    return characters * BITS_PER_CHARACTER / baud
