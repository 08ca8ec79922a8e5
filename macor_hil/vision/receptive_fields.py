"""Receptive fields: the distribution of colour around the robot as the features x.

The paper's fields are "specially tuned" and not printed. Chosen here: the panorama is cut into
sectors fixed to the robot's heading, and each sector gives the mean of each opponent channel.
The share of the bright or coloured wall in a sector grows as the wall comes nearer, so these means
are an implicit description of the obstacles around. Each channel is then stretched to the range
it had in a first drive (1st to 99th percentile): features must fill [0, 1], or the vigilance
means nothing.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from macor_hil.vision.opponent import CHANNELS, opponent_colours
from macor_hil.vision.unwrap import Image

Features = NDArray[np.float64]
"""Visual features x of one frame: shape (M,), each in [0, 1]."""

RANGE_PERCENTILES = (1.0, 99.0)


@dataclass(frozen=True, slots=True)
class ReceptiveFields:
    """Sectors with the tuned range of each opponent channel.

    Attributes:
        sectors: how many sectors lie around the robot; must divide the panorama's columns. The
            first one begins behind the robot, and they go on clockwise over the left side.
        low, high: values of each channel that become 0 and 1.
    """

    sectors: int = 12
    low: tuple[float, ...] = (0.0, 0.0, 0.0)
    high: tuple[float, ...] = (1.0, 1.0, 1.0)

    @property
    def size(self) -> int:
        """Number of features M."""
        return self.sectors * len(CHANNELS)

    def raw(self, panorama: Image) -> Features:
        """Mean of each channel in each sector, untuned: shape (sectors * 3,)."""
        colours = opponent_colours(panorama)
        columns = colours.mean(axis=0, dtype=np.float64)
        means: Features = columns.reshape(self.sectors, -1, len(CHANNELS)).mean(axis=1).ravel()
        return means

    def __call__(self, panorama: Image) -> Features:
        """The features x of a panorama."""
        return self.tune(self.raw(panorama))

    def tune(self, raw: Features) -> Features:
        """Stretch raw means, shape (..., sectors * 3), to the tuned range."""
        low, high = np.tile(self.low, self.sectors), np.tile(self.high, self.sectors)
        tuned: Features = np.clip((raw - low) / (high - low), 0.0, 1.0)
        return tuned

    def tuned_to(self, raw: Features) -> "ReceptiveFields":
        """The same fields, tuned to the range of recorded raw features, shape (frames, M)."""
        channels = raw.reshape(-1, len(CHANNELS))
        low, high = np.percentile(channels, RANGE_PERCENTILES, axis=0)
        # a channel without any contrast says nothing: leave it flat instead of amplifying noise
        flat = high - low < 0.02
        low, high = np.where(flat, 0.0, low), np.where(flat, 1.0, high)
        return ReceptiveFields(self.sectors, tuple(low.tolist()), tuple(high.tolist()))
