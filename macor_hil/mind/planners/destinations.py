"""Destinations: what a robot can be told to drive to, or along, as its camera sees them."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from khepera_protocol.text import did_you_mean, quoted

from macor_hil.arrays import Array, Mask
from macor_hil.errors import MacorError

_ALONG: Final = "along:"
LAMP: Final = "lamp"

_CHANNELS: Final = {"blue": (0,), "green": (1,), "red": (2,), "yellow": (1, 2)}
"""Channels of `eyes.sights` that are brighter than all others where something has the colour."""

NAMES: Final = (*_CHANNELS, LAMP, *(_ALONG + colour for colour in _CHANNELS))

_COLOURED: Final = 0.16
"""Least difference of the darkest of these channels from the brightest other one."""

_NEAR: Final = 2.0
"""Heights within which a colour is reached: 12 cm from the middle of the robot."""

_LIGHT, _ROW = 3, 4
_BRIGHT: Final = 0.55
"""Least brightness of a lamp."""

_HIGH: Final = 0.9
"""Row from which on a lamp is reached, which is seen the higher, the nearer it is: 12 cm."""


@dataclass(frozen=True, slots=True)
class Destination:
    """A destination.

    Attributes:
        name: as it was given.
        what: a colour, or a lamp.
        along: whether to stay near it; otherwise the drive ends there.
    """

    name: str
    what: str
    along: bool = False

    def shown(self, sights: Array) -> Mask:
        """Return in which sectors it is seen, shape (..., 24), by sights of shape (..., 24, 5)."""
        if self.what == LAMP:
            return np.asarray(sights[..., _LIGHT] >= _BRIGHT)
        own = _CHANNELS[self.what]
        other = [channel for channel in range(3) if channel not in own]
        least = sights[..., own].min(axis=-1) - sights[..., other].max(axis=-1)
        return np.asarray(least > _COLOURED)

    def reached(self, floor: Array, sights: Array) -> Mask:
        """Return whether it is so near that the robot is there, shape (...).

        Args:
            floor: profiles, shape (..., directions).
            sights: shape (..., 24, 5).
        """
        if self.what == LAMP:
            return np.asarray((self.shown(sights) & (sights[..., _ROW] >= _HIGH)).any(axis=-1))
        near = _nearest(floor, sights.shape[-2]) > 1.0 / _NEAR
        return np.asarray((self.shown(sights) & near).any(axis=-1))

    def bearing(self, floor: Array, sights: Array) -> float | None:
        """Return the direction in which it is nearest, radians to the left; None: it is not seen.

        Args:
            floor: one profile, shape (directions,).
            sights: shape (24, 5).
        """
        shown = self.shown(sights)
        if not shown.any():
            return None
        sectors = len(sights)
        near = sights[:, _ROW] if self.what == LAMP else _nearest(floor, sectors)
        sector = int(np.argmax(np.where(shown, near, -np.inf)))
        return float(np.pi - (sector + 0.5) * 2 * np.pi / sectors)


def destination(name: str) -> Destination:
    """Return the destination of a name.

    Raises:
        MacorError: there is none of that name.
    """
    if name not in NAMES:
        raise MacorError(
            f"there is no goal {quoted(name)}; {did_you_mean(name, NAMES)}there are"
            f" {', '.join(NAMES)}"
        )
    return Destination(name, name.removeprefix(_ALONG), name.startswith(_ALONG))


def _nearest(floor: Array, sectors: int) -> Array:
    """Return the least inverse distance in each sector: all of it is as near, (..., sectors)."""
    begins = np.arange(sectors) * floor.shape[-1] // sectors
    nearest: Array = np.minimum.reduceat(floor, begins, axis=-1)
    return nearest
