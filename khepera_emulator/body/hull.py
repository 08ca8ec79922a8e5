"""The hull of a robot and the mast of its camera: what the others see of it."""

from typing import Final

from khepera_emulator.models import Model
from khepera_emulator.world.looks import Drum, Look

GROUND_CLEARANCE: Final = 0.003
"""Metres between the floor and the hull's lower edge."""

HULL_COLOUR: Final = (0.25, 0.27, 0.30)

MAST_RADIUS, MAST_HEIGHT = 0.012, 0.055
"""Of the camera's mast on a robot's back, which the others see."""


def robot_look(model: Model, x: float, y: float) -> list[Look]:
    """Return what a robot looks like at a place in metres; round, it looks alike from all sides."""
    return [
        Drum(x, y, model.radius, GROUND_CLEARANCE, model.height, HULL_COLOUR),
        Drum(x, y, MAST_RADIUS, model.height, MAST_HEIGHT, HULL_COLOUR),
    ]
