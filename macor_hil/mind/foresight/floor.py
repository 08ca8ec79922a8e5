"""The free floor around the robot: the line along which it ends, and how near a place is to it."""

from functools import lru_cache
from typing import Final

import numpy as np
from khepera_protocol.system.compiled import Kernel

from macor_hil.arrays import Array, Mask
from macor_hil.mind.eyes.floor_profile import azimuths

_JUMP: Final = 0.05
"""Change of inverse distance from one direction to the next up to which both are one solid."""

_GAP: Final = 1.5
"""Heights: what is nearer to each other than that leaves no way for the robot."""

_SOLIDS: Final = Kernel("macor_hil.mind.foresight.compiled_floor:solids", 4_000)
_CLEARANCE: Final = Kernel("macor_hil.mind.foresight.compiled_floor:clearance", 4_000)


@lru_cache(maxsize=8)
def _units(directions: int) -> tuple[Array, Array]:
    """Return cosine and sine of each direction."""
    azimuth = azimuths(directions)
    return np.cos(azimuth), np.sin(azimuth)


def line_of(profile: Array) -> Array:
    """Return the places where the floor ends, shape (directions, 2), of a profile."""
    line: Array = np.stack(_units(len(profile)), axis=1) / profile[:, None]
    return line


def joined(profile: Array, line: Array) -> Mask:
    """Return between which places of the line and the next ones there is something solid."""
    step = np.roll(line, -1, axis=0) - line
    one: Mask = np.abs(profile - np.roll(profile, -1)) < _JUMP
    return one | (np.hypot(step[:, 0], step[:, 1]) < _GAP)


def solids(profile: Array) -> tuple[Array, Array]:
    """Return the beginnings and the ends of straight solid pieces, both of shape (n, 2)."""
    arguments = profile, *_units(len(profile)), _JUMP, _GAP
    if _SOLIDS.pays(*arguments):
        pieces: tuple[Array, Array] = _SOLIDS(*arguments)
        return pieces
    line = line_of(profile)
    solid = joined(profile, line)
    return line[solid], np.roll(line, -1, axis=0)[solid]


def clearance(solid: tuple[Array, Array], places: Array) -> Array:
    """Return the distance from each place, shape (n, 2), to the nearest solid piece; n of them."""
    begin, end = solid
    if not len(begin):
        return np.full(len(places), np.inf)
    along = end - begin
    products = places @ along.T
    if _CLEARANCE.pays(begin, end, places, products):
        found: Array = _CLEARANCE(begin, end, places, products)
        return found
    length = np.maximum((along * along).sum(axis=1), 1e-9)
    share = (products - (begin * along).sum(axis=1)) / length
    share = np.clip(share, 0.0, 1.0)
    x = places[:, :1] - (begin[:, 0] + share * along[:, 0])
    y = places[:, 1:] - (begin[:, 1] + share * along[:, 1])
    nearest: Array = np.sqrt((x * x + y * y).min(axis=1))
    return nearest
