"""The e-pucks, number by number; see `khepera_emulator.models` for units.

Sources disagree on where the infrared sensors sit: `PLACES` has them all.
"""

from dataclasses import dataclass
from math import radians
from types import MappingProxyType
from typing import Final

from khepera_protocol.epuck.units import (
    BODY_RADIUS,
    PROXIMITY_FULL,
    STEP,
    WHEEL_BASE,
    WHEEL_DIAMETER,
)

from khepera_emulator.models import Model, ProximityCurve

_FOUR = tuple[float, float, float, float]

PLACES: Final = MappingProxyType[str, _FOUR](
    {
        "firmware": (15.0, 45.0, 90.0, 150.0),
        "webots": (17.2, 45.9, 90.0, 151.5),
        "ros": (10.0, 40.0, 90.0, 160.0),
        "enki": (18.0, 45.0, 90.0, 142.0),
    }
)
"""Bearings of the four right sensors in degrees clockwise, by who says so; the left ones mirror."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EpuckModel(Model):
    """An e-puck.

    Attributes:
        profiles: names of its firmwares, the usual one first.
        fast_timer: whether steps are timed in hundredths of a millisecond, and not in tenths.
        one_g: digits of the accelerometer for 1 g, in A.
        offsets: what each infrared sensor reads of its own light without an object (a choice).
        battery: raw reading, and those of an empty and of a full battery.
        volumes: microphones.
        eye_height: metres of the camera above the floor (a choice).
        field: radians that the camera's 640 columns see.
    """

    kind: str = "epuck"
    profiles: tuple[str, ...]
    fast_timer: bool
    one_g: int
    offsets: tuple[int, ...] = (38, 24, 41, 19, 27, 33, 22, 36)
    battery: tuple[int, int, int]
    volumes: int
    eye_height: float = 0.028
    field: float = 0.84


def ring(places: str) -> tuple[float, ...]:
    """Return the bearings of the eight sensors in radians, left positive, by a source's name."""
    right = PLACES[places]
    return tuple(radians(angle) for angle in (*(-a for a in right), *reversed(right)))


# Webots' look-up for a white wall; nothing is known of its spread
_RESPONSE: Final = (
    (0, 4095),
    (5, 2133),
    (10, 1466),
    (15, 601),
    (20, 384),
    (30, 235),
    (40, 158),
    (50, 120),
    (60, 104),
    (70, 67),
    (100, 0),  # beyond the table (a choice)
)

_PROXIMITY = ProximityCurve(
    gaps=tuple(mm / 1000 for mm, _ in _RESPONSE),
    counts=(tuple(count for _, count in _RESPONSE),) * 8,
    residual=(0,) * 8,
    step=1,
    noise=(3.0, 0.02),
    full=PROXIMITY_FULL,
)

_TOP_SPEED: Final = 1000 * STEP
_RING: Final = ring("firmware")

EPUCK: Final = EpuckModel(
    name="epuck",
    title="e-puck (2004), hardware 1.3",
    radius=BODY_RADIUS,
    height=0.047,
    mass=0.150,
    wheel_radius=WHEEL_DIAMETER / 2,
    wheel_base=WHEEL_BASE,
    top_speed=_TOP_SPEED,
    sensor_bearings=_RING,
    sensor_directions=_RING,
    proximity=_PROXIMITY,
    dark=4000,
    profiles=("gctronic", "btcom"),
    fast_timer=False,
    one_g=800,
    battery=(2380, 2070, 2560),
    volumes=3,
)

EPUCK2: Final = EpuckModel(
    name="epuck2",
    title="e-puck2 (2018)",
    radius=BODY_RADIUS,
    height=0.047,
    mass=0.130,
    wheel_radius=WHEEL_DIAMETER / 2,
    wheel_base=WHEEL_BASE,
    top_speed=1.1 * _TOP_SPEED,
    sensor_bearings=_RING,
    sensor_directions=_RING,
    proximity=_PROXIMITY,
    dark=4000,
    profiles=("gctronic2", "wifi"),
    fast_timer=True,
    one_g=750,
    battery=(3195, 2785, 3441),
    volumes=4,
)
