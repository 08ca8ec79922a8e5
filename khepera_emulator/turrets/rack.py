"""The turrets of one robot, mounted on it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from inspect import signature
from typing import Any
from zlib import crc32

import numpy as np
from khepera_protocol.serial.turrets import TURRETS, TurretKind

from khepera_emulator.turrets.radio import RadioMedium
from khepera_emulator.turrets.turret import BusTurret, MessageTurret, Site, Turret


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

    @property
    def kinds(self) -> tuple[TurretKind, ...]:
        """Kinds of the turrets, the lowest first."""
        return tuple(turret.kind for turret in self.turrets)

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
        """Return the turret that T addresses by a number."""
        return self._by_number.get(number)

    def read_bus(self, address: int) -> int | None:
        """Return the byte that a turret puts on the bus; None if no turret answers."""
        bytes_ = (turret.read_bus(address) for turret in self._bus)
        return next((byte for byte in bytes_ if byte is not None), None)

    def write_bus(self, address: int, data: int) -> None:
        """Put a byte on the bus for all turrets."""
        for turret in self._bus:
            turret.write_bus(address, data)

    def analogue(self, channel: int) -> int | None:
        """Return counts at an A/D channel that a turret drives; None if none does."""
        counts = (turret.analogue(channel) for turret in self._bus)
        return next((count for count in counts if count is not None), None)


@dataclass(frozen=True, slots=True)
class Fittings:
    """Parts of a robot that a turret's constructor may ask for, by their names here.

    Attributes:
        site: where the turret is mounted.
        medium: the air that the radios of a world share.
        number: what other robots' radios call this robot.
        first: number of the leftmost pixel of an image.
    """

    site: Site
    medium: RadioMedium
    number: int = 1
    first: int = 1


def mount(turrets: Iterable[Any], fittings: Fittings, rng: np.random.Generator) -> Rack:
    """Put turrets on a robot.

    Args:
        turrets: their classes.
        fittings: what they may ask for; `rng`, too.
        rng: source of their randomness; each kind has a stream of its own, so that what one
            reads does not depend on the others.
    """
    streams = _Streams(rng)
    given = {field.name: getattr(fittings, field.name) for field in fields(fittings)}
    made = []
    for turret in turrets:
        wanted = signature(turret).parameters
        mine = {name: value for name, value in given.items() if name in wanted}
        if "rng" in wanted:
            mine["rng"] = streams.of(turret.kind)
        made.append(turret(**mine))
    return Rack(made)


class _Streams:
    """Independent random numbers for every kind of turret, mounted or not."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._known = dict(zip(TURRETS, rng.spawn(len(TURRETS)), strict=True))
        self._seeds: Any = rng.bit_generator.seed_seq

    def of(self, kind: TurretKind) -> np.random.Generator:
        """Return the stream of a kind; that of a kind of others depends on its name."""
        if kind.name in self._known:
            return self._known[kind.name]
        key = (*self._seeds.spawn_key, crc32(kind.name.encode()))
        return np.random.default_rng(np.random.SeedSequence(self._seeds.entropy, spawn_key=key))
