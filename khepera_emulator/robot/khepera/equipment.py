"""Equipment of one robot: what makes it differ from another of its model."""

from dataclasses import dataclass, field
from typing import Any

from khepera_emulator.robot.khepera.choices import Choices
from khepera_emulator.turrets.radio import RadioMedium


@dataclass(frozen=True, slots=True)
class Equipment:
    """Turrets and firmware of one Khepera.

    Attributes:
        turrets: their classes.
        choices: of its firmware.
        radio: the air of its world.
        number: what other robots' radios call it.
    """

    turrets: tuple[Any, ...] = ()
    choices: Choices = Choices()  # noqa: RUF009 - an immutable value
    radio: RadioMedium = field(default_factory=RadioMedium)
    number: int = 1
