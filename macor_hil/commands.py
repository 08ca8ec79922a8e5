"""Motor commands of the paper (section 3.1), as values; `drive` executes them."""

from dataclasses import dataclass
from math import radians
from typing import Final


@dataclass(frozen=True, slots=True)
class MotorCommand:
    """An arc of a length in metres that turns by an angle in radians, left positive."""

    name: str
    turn: float
    way: float = 0.021


LEFT: Final = MotorCommand("left", radians(12))
RIGHT: Final = MotorCommand("right", radians(-12))
STRAIGHT: Final = MotorCommand("straight", 0.0)

COMMANDS: Final = (LEFT, RIGHT, STRAIGHT)
"""The three commands of the paper: s = 2.1 cm each, turning 12, -12 or 0 degrees."""

LONGEST_WAY: Final = max(command.way for command in COMMANDS)
"""Metres that a command takes a robot that nobody can stop."""

MIRRORED: Final = (COMMANDS.index(RIGHT), COMMANDS.index(LEFT), COMMANDS.index(STRAIGHT))
"""Index of the command that drives the mirror image of each."""

FIRST_COMMAND: Final = COMMANDS.index(STRAIGHT)
"""Command that a situation counts as entered by when the robot was put there."""
