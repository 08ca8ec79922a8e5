"""Errors that the encoders do not see: unequal wheels, a wrong wheel base, and slip.

The counters of H are exact numbers of wheel rotation; drift turns the counted way of each wheel
into its way over ground. Systematic errors are drawn once for each robot, slip every 10 ms.
"""

from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Final

import numpy as np
from khepera_protocol.text import quoted
from khepera_protocol.zenoh.payloads import WheelDrift

from khepera_emulator.body.drawn import Drawn, Numbers
from khepera_emulator.errors import EmulatorError


@dataclass(frozen=True, slots=True)
class DriftSettings:
    """Standard deviations from which a robot's drift is drawn, all relative.

    Attributes:
        scale: way of a wheel over its counted way; a half percent is a mediocre calibration
            (clients of real robots differ by 4 % on the length of a count).
        base: wheel base over its nominal value (clients differ by 8 %).
        slip: way of each wheel in one 10 ms period, independent from period to period; doubled
            while the robot turns on the spot.
    """

    scale: float = 0.0
    base: float = 0.0
    slip: float = 0.0


DEFAULT_DRIFT: Final = "default"

SLIP_BLOCK: Final = 256
"""Control periods whose slips are drawn at once."""

PRESETS: Final = MappingProxyType(
    {
        "none": DriftSettings(),
        DEFAULT_DRIFT: DriftSettings(scale=0.005, base=0.01, slip=0.015),
        # O. Michel's Khepera Simulator: 10 % on the way, 5 % on the turn, each step
        "strong": DriftSettings(scale=0.02, base=0.04, slip=0.10),
    }
)


def parse_drift(text: str) -> DriftSettings:
    """Read `--drift`: a preset's name, or for example `scale=0.01,slip=0.05`.

    Raises:
        EmulatorError: neither.
    """
    if text in PRESETS:
        return PRESETS[text]
    known = [field.name for field in fields(DriftSettings)]
    values: dict[str, float] = {}
    for item in text.split(","):
        name, _, number = item.partition("=")
        try:
            value = float(number)
        except ValueError:
            value = -1.0
        if name not in known or not 0.0 <= value < 0.5:
            raise EmulatorError(
                f"cannot read the drift {quoted(text)}; give {', '.join(PRESETS)}, or items of"
                f" {', '.join(known)} such as scale=0.01,slip=0.05 (each from 0 to below 0.5)"
            )
        values[name] = value
    return DriftSettings(**values)


def draw_drift(settings: DriftSettings, wheel_base: float, rng: np.random.Generator) -> WheelDrift:
    """Draw the systematic errors of one robot; `wheel_base` is the nominal one in metres."""
    left, right, base = rng.standard_normal(3)
    return WheelDrift(
        left_scale=1.0 + settings.scale * float(left),
        right_scale=1.0 + settings.scale * float(right),
        wheel_base=wheel_base * (1.0 + settings.base * float(base)),
        slip=settings.slip,
    )


def slips(rng: np.random.Generator, block: int = SLIP_BLOCK) -> Numbers:
    """Draw standard normal pairs, one for each control period, shape (block, 2)."""
    return rng.standard_normal((block, 2))


def slip_sequence(rng: np.random.Generator, block: int = SLIP_BLOCK) -> Drawn:
    """Return endless slips."""
    return Drawn(lambda: slips(rng, block))
