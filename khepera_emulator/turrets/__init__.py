"""Turrets: modules stacked on a robot, one file each, behind the interface in `turret`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from khepera_protocol.serial.turrets import TURRETS
from khepera_protocol.text import quoted

from khepera_emulator.choices import Choices
from khepera_emulator.errors import EmulatorError
from khepera_emulator.turrets.general_io import GeneralIO
from khepera_emulator.turrets.gripper import Gripper
from khepera_emulator.turrets.k213 import K213
from khepera_emulator.turrets.radio import Radio, RadioMedium
from khepera_emulator.turrets.turret import BusTurret, MessageTurret, Site, Turret

__all__ = ["TURRETS", "Equipment", "Rack", "RadioMedium", "Site", "check_turrets", "mount"]


@dataclass(frozen=True, slots=True)
class Equipment:
    """What makes one Khepera differ from another of its model.

    Attributes:
        turrets: names of `khepera_protocol.serial.turrets.TURRETS`.
        choices: of its firmware.
        radio: the air of its world.
        number: what other robots' radios call it.
    """

    turrets: tuple[str, ...] = ()
    choices: Choices = Choices()  # noqa: RUF009 - an immutable value
    radio: RadioMedium = field(default_factory=RadioMedium)
    number: int = 1


class Rack:
    """The turrets on one robot.

    Args:
        turrets: from the lowest to the topmost; bus and inputs are the lowest one's that answers.
    """

    def __init__(self, turrets: Sequence[Turret]) -> None:
        self.turrets = tuple(turrets)
        self._by_number = {
            turret.kind.number: turret
            for turret in self.turrets
            if isinstance(turret, MessageTurret)
        }
        self._bus = [turret for turret in self.turrets if isinstance(turret, BusTurret)]

    def __bool__(self) -> bool:
        return bool(self.turrets)

    def power_on(self) -> None:
        """Begin afresh."""
        for turret in self.turrets:
            turret.power_on()

    def step(self, now: float) -> None:
        """Let time pass up to `now`, in seconds of the robot."""
        for turret in self.turrets:
            turret.step(now)

    def find(self, number: int) -> MessageTurret | None:
        """The turret that T addresses by a number."""
        return self._by_number.get(number)

    def read_bus(self, address: int) -> int | None:
        """The byte that a turret puts on the bus; None if no turret answers."""
        bytes_ = (turret.read_bus(address) for turret in self._bus)
        return next((byte for byte in bytes_ if byte is not None), None)

    def write_bus(self, address: int, data: int) -> None:
        """A byte on the bus for all turrets."""
        for turret in self._bus:
            turret.write_bus(address, data)

    def analogue(self, channel: int) -> int | None:
        """Counts at an A/D channel that a turret drives; None if none does."""
        counts = (turret.analogue(channel) for turret in self._bus)
        return next((count for count in counts if count is not None), None)


def check_turrets(names: Sequence[str]) -> tuple[str, ...]:
    """Names of turrets as they come from outside.

    Raises:
        EmulatorError: an unknown one, or one named twice.
    """
    for name in names:
        if name not in TURRETS:
            raise EmulatorError(f"unknown turret {quoted(name)}; there are {', '.join(TURRETS)}")
        if names.count(name) > 1:
            raise EmulatorError(
                f"turret {quoted(name)} is named twice; a robot carries one of each"
            )
    return tuple(names)


def mount(equipment: Equipment, site: Site, rng: np.random.Generator) -> Rack:
    """Put a robot's turrets on it.

    Args:
        equipment: which ones.
        site: where they find themselves.
        rng: source of their randomness; each kind has a stream of its own, so that what one
            reads does not depend on the others.
    """
    streams = dict(zip(TURRETS, rng.spawn(len(TURRETS)), strict=True))
    first = 0 if equipment.choices.pixels_from_zero else 1
    makers: dict[str, Callable[[], Turret]] = {
        "gripper": lambda: Gripper(site),
        "k213": lambda: K213(site, streams["k213"], first),
        "radio": lambda: Radio(equipment.radio, equipment.number),
        "general-io": GeneralIO,
    }
    return Rack([makers[name]() for name in equipment.turrets])
