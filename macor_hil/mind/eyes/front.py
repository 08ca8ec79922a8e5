"""Eyes for a camera that looks ahead: fields side by side and one above the other in its picture.

A field gives the mean of each opponent channel, as those around the robot do
(`receptive_fields`); the lower ones see where the floor ends. What lies beside and behind the
robot is not seen.
"""

from functools import lru_cache
from typing import Annotated

import numpy as np
from khepera_protocol.mirror import Mirror
from pydantic import Field

from macor_hil.arrays import Array, Image, State
from macor_hil.errors import CameraError
from macor_hil.mind.eyes.opponent import CHANNELS, opponent_colours
from macor_hil.mind.eyes.receptive_fields import RANGE_PERCENTILES
from macor_hil.mind.stored import numbers

_LEAST_RANGE = 0.02
"""Range of a channel below which it has no contrast, and stays as it is."""


class FrontEyes:
    """Mean colours of overlapping fields, stretched to the range of a first drive.

    Args:
        across: fields side by side, with Gaussian profiles half a field wide.
        rows: of fields, one above the other.
    """

    def __init__(
        self,
        across: Annotated[int, Field(ge=1, le=64)] = 6,
        rows: Annotated[int, Field(ge=1, le=64)] = 2,
    ) -> None:
        self._across, self._rows = across, rows
        self._low, self._high = np.zeros(len(CHANNELS)), np.ones(len(CHANNELS))

    @property
    def size(self) -> int:
        """Number of features M."""
        return self._across * self._rows * len(CHANNELS)

    @property
    def raw_size(self) -> int:
        """Number of untuned features R, one for each feature."""
        return self.size

    @property
    def mirror(self) -> None:
        """Geometry of a mirror: they look into none."""
        return None

    @property
    def picture_size(self) -> None:
        """Width and height of the pictures: any."""
        return None

    def look_through(self, mirror: Mirror) -> None:
        """Change nothing: they look into no mirror."""

    def look(self, image: Image) -> Array:
        """Return the mean of each channel in each field, rows from above, fields from the left.

        Raises:
            CameraError: the picture has fewer pixels than there are fields.
        """
        height, width = image.shape[:2]
        if width < self._across or height < self._rows:
            raise CameraError(
                f"a picture of {width} x {height} pixels is too small for {self._across} x"
                f" {self._rows} fields"
            )
        bands = np.array_split(image, self._rows)
        columns = opponent_colours(np.array([band.mean(axis=0) for band in bands]))
        fields: Array = np.einsum("fw,rwc->rfc", _profiles(self._across, width), columns)
        return fields.ravel()

    def tuned(self, raw: Array) -> Array:
        """Stretch means to the tuned range."""
        channels = raw.reshape(*raw.shape[:-1], -1, len(CHANNELS))
        x: Array = np.clip((channels - self._low) / (self._high - self._low), 0.0, 1.0)
        return x.reshape(raw.shape)

    def tune(self, raw: Array) -> None:
        """Take the range of each channel, 1st to 99th percentile, of what was seen."""
        low, high = np.percentile(raw.reshape(-1, len(CHANNELS)), RANGE_PERCENTILES, axis=0)
        flat = high - low < _LEAST_RANGE
        self._low, self._high = np.where(flat, 0.0, low), np.where(flat, 1.0, high)

    def mirrored(self, x: Array) -> Array:
        """Exchange left and right."""
        fields = x.reshape(*x.shape[:-1], self._rows, self._across, len(CHANNELS))
        return fields[..., ::-1, :].reshape(x.shape)

    def state(self) -> State:
        """Return the tuned range of each channel."""
        return {"low": self._low, "high": self._high}

    def load(self, state: State) -> None:
        """Take over tuned ranges.

        Raises:
            ValueError, KeyError: they are missing, or not one of each channel.
        """
        channels = (len(CHANNELS),)
        low, high = (numbers(state, name, channels, -10.0, 10.0) for name in ("low", "high"))
        if (high - low < _LEAST_RANGE / 2).any():
            raise ValueError("the range of a channel is empty")
        self._low, self._high = low, high


@lru_cache(maxsize=8)
def _profiles(fields: int, columns: int) -> Array:
    """Return the weight of each column of a picture in each field, shape (fields, columns)."""
    centres = (np.arange(fields) + 0.5) / fields
    places = (np.arange(columns) + 0.5) / columns
    weights = np.exp(-0.5 * ((places - centres[:, None]) * 2 * fields) ** 2)
    profiles: Array = weights / weights.sum(axis=1, keepdims=True)
    return profiles
