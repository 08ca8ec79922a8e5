"""A compass: a turret that knows where the robot heads, to two degrees."""

from math import degrees

import numpy as np
from khepera_protocol.serial.commands import Field
from khepera_protocol.serial.turrets import TurretMessage, turret_kind

from khepera_emulator.turrets.turret import Site, Values

STEP = 2
"""Degrees between two readings that differ."""

NOISE = 1.0
"""Standard deviation of a reading in degrees."""


class Compass:
    """The compass of one robot.

    Args:
        site: where it is mounted.
        rng: source of its noise.
    """

    kind = turret_kind(
        "compass",
        "Compass: the heading to two degrees",
        40,
        "an example",
        TurretMessage(
            "B", "Read software version", (), (Field("version", 0, 9), Field("revision", 0, 9))
        ),
        TurretMessage("H", "Read heading", (), (Field("heading", 0, 359, "degrees"),)),
    )

    def __init__(self, site: Site, rng: np.random.Generator) -> None:
        self._site = site
        self._rng = rng

    def power_on(self) -> None:
        """Begin afresh: it remembers nothing."""

    def step(self, now: float) -> None:
        """Let time pass: nothing here takes time."""

    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        """Carry out a message."""
        del arguments, now
        if letter == "B":
            return 1, 0
        heading = degrees(self._site.place()[2]) + self._rng.normal(0.0, NOISE)
        return (round(heading / STEP) * STEP % 360,)
