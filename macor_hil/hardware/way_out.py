"""A way on after a collision, for a robot that nobody carries: back along its trail, and a turn."""

from math import pi

import numpy as np

from macor_hil.hardware.driver import Driver

STUCK = 8
"""Collisions at once in a row after which driving back does not help."""


def drive_away(driver: Driver, rng: np.random.Generator, *, turn: bool) -> None:
    """Drive back by three to eight commands, and turn by any angle if that is wanted.

    Args:
        driver: of a robot that has collided, and stands.
        rng: source of both.
        turn: for a robot that has no way back worth the name.

    Raises:
        RobotError, CameraError: the hardware fails.
    """
    driver.back_off(int(rng.integers(3, 9)))
    if turn:
        driver.turn(float(rng.uniform(-pi, pi)))
