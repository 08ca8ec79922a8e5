"""The default eyes: the mirror image is unwrapped, receptive fields around the robot read it."""

from dataclasses import replace
from typing import Annotated, Final

import numpy as np
from khepera_protocol.mirror import Mirror
from pydantic import Field

from macor_hil.arrays import Array, Image, State
from macor_hil.mind.eyes.receptive_fields import ReceptiveFields
from macor_hil.mind.eyes.unwrap import PanoramaSize, Unwrapper
from macor_hil.mind.stored import numbers

_LEAST_RANGE: Final = 1e-3


class PanoramaEyes:
    """Receptive fields on the panorama of an omnidirectional camera.

    Args:
        mirror: geometry of the camera's mirror.
        sectors: receptive fields around the robot; must divide the panorama's columns.
        panorama: size of the unwrapped picture.

    Attributes:
        fields: the receptive fields with their tuned ranges.
        unwrap: turns mirror images into panoramas.
    """

    def __init__(
        self,
        mirror: Mirror,
        sectors: Annotated[int, Field(ge=1, le=120)] = 12,
        panorama: PanoramaSize = PanoramaSize(),  # noqa: B008 - a value
    ) -> None:
        self.fields = ReceptiveFields(sectors)
        self.unwrap = Unwrapper(mirror, panorama)
        self._panorama = panorama

    @property
    def size(self) -> int:
        """Number of features M."""
        return self.fields.size

    @property
    def raw_size(self) -> int:
        """Number of untuned features R, one for each feature."""
        return self.size

    @property
    def mirror(self) -> Mirror:
        """Geometry of the camera's mirror."""
        return self.unwrap.mirror

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height that the mirror is described for."""
        return self.mirror.width, self.mirror.height

    def look_through(self, mirror: Mirror) -> None:
        """See through another mirror than the one that was tuned with."""
        self.unwrap = Unwrapper(mirror, self._panorama)

    def look(self, image: Image) -> Array:
        """Return the mean of each channel in each field, untuned."""
        return self.fields.raw(self.unwrap(image))

    def tuned(self, raw: Array) -> Array:
        """Stretch raw means to the tuned range."""
        return self.fields.tune(raw)

    def tune(self, raw: Array) -> None:
        """Tune the range of each channel to what was seen."""
        self.fields = self.fields.tuned_to(raw)

    def mirrored(self, x: Array) -> Array:
        """Exchange left and right."""
        return self.fields.mirrored(x)

    def state(self) -> State:
        """Return the tuned range of each channel."""
        return {"low": np.array(self.fields.low), "high": np.array(self.fields.high)}

    def load(self, state: State) -> None:
        """Take over tuned ranges.

        Raises:
            ValueError, KeyError: they are missing, or not one of each channel.
        """
        channels = (len(self.fields.low),)
        low, high = (numbers(state, name, channels, -10.0, 10.0) for name in ("low", "high"))
        if (high - low < _LEAST_RANGE).any():
            raise ValueError("the range of a channel is empty")
        self.fields = replace(self.fields, low=tuple(low.tolist()), high=tuple(high.tolist()))
