"""Receptive fields: the distribution of colour around the robot as the features x.

The paper's fields are "specially tuned" and not printed. Chosen here: fields fixed to the robot's
heading, evenly around it, each with a Gaussian profile over azimuth that overlaps its neighbours';
a field gives the mean of each opponent channel over all elevations. The share of wall in it grows
as the wall comes nearer, so these means are an implicit description of the obstacles around. Each
channel is then stretched to the range it had in a first drive (1st to 99th percentile): features
must fill [0, 1], or the vigilance means nothing.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import radians

import numpy as np

from macor_hil.arrays import Array, Image
from macor_hil.mind.eyes.opponent import CHANNELS, opponent_colours

RANGE_PERCENTILES = (1.0, 99.0)


@dataclass(frozen=True, slots=True)
class ReceptiveFields:
    """Fields around the robot, with the tuned range of each opponent channel.

    Attributes:
        sectors: how many fields; the first one looks behind the robot's left side, and they go on
            clockwise. Must divide the panorama's columns.
        width: standard deviation of a field's profile, radians.
        low: value of each channel that becomes 0.
        high: value of each channel that becomes 1.
    """

    sectors: int = 12
    width: float = radians(15.0)
    low: tuple[float, ...] = (0.0, 0.0, 0.0)
    high: tuple[float, ...] = (1.0, 1.0, 1.0)

    @property
    def size(self) -> int:
        """Number of features M."""
        return self.sectors * len(CHANNELS)

    def raw(self, panorama: Image) -> Array:
        """Return the mean of each channel in each field, untuned: shape (sectors * 3,)."""
        # both steps are linear: averaging over elevation first leaves little to transform
        return self.raw_of(panorama.mean(axis=0))

    def raw_of(self, means: Array) -> Array:
        """Return the same of the mean colour of each column, shape (columns, 3)."""
        columns = opponent_colours(means)
        fields: Array = (_profiles(self.sectors, len(columns), self.width) @ columns).ravel()
        return fields

    def __call__(self, panorama: Image) -> Array:
        """Return the features x of a panorama."""
        return self.tune(self.raw(panorama))

    def tune(self, raw: Array) -> Array:
        """Stretch raw means, shape (..., sectors * 3), to the tuned range."""
        low, high = _ranges(self.low, self.high, self.sectors)
        tuned: Array = np.clip((raw - low) / (high - low), 0.0, 1.0)
        return tuned

    def mirrored(self, features: Array) -> Array:
        """Return features of the mirror image of the world: shape (..., sectors * 3), as given."""
        fields = features.reshape(*features.shape[:-1], self.sectors, len(CHANNELS))
        return fields[..., ::-1, :].reshape(features.shape)

    def tuned_to(self, raw: Array) -> "ReceptiveFields":
        """Return the same fields tuned to the range of recorded raw features, shape (frames, M)."""
        channels = raw.reshape(-1, len(CHANNELS))
        low, high = np.percentile(channels, RANGE_PERCENTILES, axis=0)
        # a channel without any contrast says nothing: leave it flat instead of amplifying noise
        flat = high - low < 0.02
        low, high = np.where(flat, 0.0, low), np.where(flat, 1.0, high)
        return replace(self, low=tuple(low.tolist()), high=tuple(high.tolist()))


@lru_cache(maxsize=8)
def _ranges(low: tuple[float, ...], high: tuple[float, ...], sectors: int) -> tuple[Array, Array]:
    """Return the least and the greatest value of each feature."""
    return np.tile(low, sectors), np.tile(high, sectors)


@lru_cache(maxsize=8)
def _profiles(sectors: int, columns: int, width: float) -> Array:
    """Return the weight of each column of the panorama in each field, shape (sectors, columns)."""
    centres = (np.arange(sectors) + 0.5) / sectors
    places = (np.arange(columns) + 0.5) / columns
    apart = (places - centres[:, None] + 0.5) % 1.0 - 0.5
    weights = np.exp(-0.5 * (2 * np.pi * apart / width) ** 2)
    profiles: Array = weights / weights.sum(axis=1, keepdims=True)
    return profiles
