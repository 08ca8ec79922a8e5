"""Turrets by name: the bundled ones, those of other distributions, and those of a file."""

from collections.abc import Sequence
from typing import Any, Final

from khepera_protocol.registry import Registry
from khepera_protocol.serial.turrets import TurretKind
from khepera_protocol.text import printable, quoted

from khepera_emulator.doors import find_part
from khepera_emulator.errors import EmulatorError

TURRET_CLASSES: Final = Registry(
    "turret",
    "khepera_macor.turrets",
    {
        "gripper": "khepera_emulator.turrets.gripper:Gripper",
        "k213": "khepera_emulator.turrets.k213:K213",
        "radio": "khepera_emulator.turrets.radio:Radio",
        "general-io": "khepera_emulator.turrets.general_io:GeneralIO",
    },
)


def find_turrets(names: Sequence[str]) -> tuple[Any, ...]:
    """Load the classes of a robot's turrets.

    Raises:
        EmulatorError: one is unknown or no turret, or two have one name or one number.
    """
    turrets = [_turret(name) for name in names]
    for place, turret in enumerate(turrets):
        for name, other in zip(names[:place], turrets[:place], strict=True):
            if turret.kind.name == other.kind.name:
                raise EmulatorError(
                    f"turret {quoted(names[place])} is named twice; a robot carries one of each"
                )
            if turret.kind.number is not None and turret.kind.number == other.kind.number:
                raise EmulatorError(
                    f"turrets {quoted(name)} and {quoted(names[place])} both answer to number"
                    f" {turret.kind.number}; a robot carries one of them"
                )
    return tuple(turrets)


def _turret(name: str) -> Any:
    found = find_part(TURRET_CLASSES, name)
    if not isinstance(getattr(found, "kind", None), TurretKind):
        raise EmulatorError(
            f"'{printable(name, 200)}' is not a turret: its attribute `kind` is not a TurretKind"
        )
    return found
