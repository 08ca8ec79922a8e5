"""An emulated robot before it is made: what its options name, read and checked."""

from dataclasses import dataclass, field
from typing import Any, Final

from khepera_protocol.mirror import Mirror

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.body.drift import DEFAULT_DRIFT, PRESETS, DriftSettings
from khepera_emulator.line.dialect import KHEPERA as DIALECT
from khepera_emulator.line.fault import Fault
from khepera_emulator.models import KHEPERA, Model

DEFAULT_SEED: Final = 0


@dataclass(frozen=True, slots=True)
class Setup:
    """Parts and properties of an emulated robot.

    Attributes:
        arena: where it drives.
        model: which robot.
        drift: how far its wheels deceive it.
        seed: of this robot (its drift), and of all that happens by chance.
        baud: rate of its line, or None for a line that takes no time.
        faults: what goes wrong on its line.
        mirror: geometry of its camera.
        turrets: classes of what is mounted on it; see `turrets.catalogue`.
        choices: of its firmware, as its kind reads them (`robot.kind`); None: the kind's own.
        dead_man: seconds without a request after which the robot stops by itself; None: never, as
            a real one.
        rigid: whether it is a rigid body in PyBullet all the time.
    """

    arena: Arena
    model: Model = KHEPERA
    drift: DriftSettings = PRESETS[DEFAULT_DRIFT]
    seed: int = DEFAULT_SEED
    baud: int | None = DIALECT.first_rate
    faults: tuple[Fault, ...] = ()
    mirror: Mirror = field(default_factory=Mirror)
    turrets: tuple[Any, ...] = ()
    choices: Any = None
    dead_man: float | None = None
    rigid: bool = False
