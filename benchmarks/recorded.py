"""Recordings of real robots: gaps in mm, angles in degrees, readings in counts."""

from typing import Final

Curve = dict[int, tuple[int, ...]]
"""Readings of the eight sensors at a gap in mm."""

KHEPERA_WALL: Final[Curve] = {
    11: (1023, 1023, 1023, 1023, 1023, 1023, 1023, 1023),
    13: (1023, 1023, 1023, 1023, 1023, 1023, 1023, 1023),
    15: (1023, 1023, 1023, 1023, 1023, 1023, 1023, 1023),
    17: (1023, 1023, 1023, 786, 1023, 1023, 1023, 1023),
    19: (1023, 1011, 835, 522, 1023, 1023, 854, 1023),
    21: (837, 776, 635, 377, 941, 1023, 641, 1023),
    23: (592, 617, 464, 279, 738, 980, 445, 931),
    25: (358, 413, 326, 112, 539, 749, 334, 761),
    27: (244, 290, 165, 16, 297, 518, 158, 481),
    29: (174, 197, 143, 6, 244, 483, 121, 495),
    31: (141, 150, 48, 0, 181, 363, 47, 356),
    33: (33, 87, 7, 0, 101, 257, 25, 265),
    35: (0, 0, 4, 0, 7, 226, 0, 200),
    37: (1, 2, 4, 3, 0, 115, 1, 110),
    39: (0, 6, 0, 1, 0, 107, 0, 94),
    41: (3, 1, 4, 1, 0, 31, 0, 57),
    43: (4, 0, 0, 0, 0, 7, 4, 11),
}
"""A first Khepera before a white wall: S. Nolfi's samples (180 headings, 20 gaps), the median
within 6 degrees of each sensor's lobe centre; the gap lies between wall and body."""

KHEPERA2_WALL: Final[Curve] = {
    10: (773, 1020, 998, 1020, 1020, 880, 994, 1014),
    20: (191, 278, 245, 311, 258, 275, 286, 363),
    30: (102, 143, 134, 181, 122, 152, 170, 239),
    40: (71, 95, 92, 132, 84, 118, 128, 194),
    50: (65, 77, 80, 116, 68, 90, 114, 176),
    60: (49, 66, 70, 102, 58, 86, 102, 163),
    70: (46, 62, 66, 96, 54, 86, 98, 163),
    80: (46, 56, 65, 91, 52, 75, 92, 156),
    90: (43, 54, 58, 90, 49, 74, 91, 154),
    100: (35, 44, 51, 61, 33, 63, 84, 141),
}
"""One Khepera II, the mean of five days (R. McGregor's and N. Hadjipavlou's course data)."""

FALL_OFF: Final[dict[int, dict[int, int]]] = {
    15: {6: 1023, 18: 1000, 24: 950, 30: 820, 36: 590, 42: 345, 48: 165, 54: 55, 60: 17},
    25: {0: 442, 6: 437, 12: 380, 18: 286, 24: 225, 30: 126, 36: 49, 42: 36, 48: 4},
}
"""Nolfi's wall at two gaps: angle between lobe and the wall's normal -> mean of the sensors."""

LAMP: Final[dict[int, int]] = {
    75: 75, 100: 100, 200: 250, 400: 375, 550: 400, 750: 425, 900: 450, 1000: 500,
}  # fmt: skip
"""Distance of a 50 W lamp in mm -> ambient light (Khepera II manual 3.1.7, read off its figure by
RoadNarrows)."""
