"""Receptive fields and, beside them, where the floor ends in every direction, and at what."""

from typing import Annotated, Final

import numpy as np
from khepera_protocol.mirror import Mirror
from khepera_protocol.system.compiled import Kernel
from pydantic import Field

from macor_hil.arrays import Array, Image
from macor_hil.mind.eyes.floor_profile import LOWEST, floor_profile, profile_of
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.mind.eyes.sights import CHANNELS, SECTORS, sights
from macor_hil.mind.eyes.unwrap import PanoramaSize

_SCAN: Final = Kernel("macor_hil.mind.eyes.panorama_scan:scan", 1_000)


class FloorEyes(PanoramaEyes):
    """Receptive fields as features; beside them the floor's profile, and what stands at its end.

    The untuned features are those of `PanoramaEyes`, followed by the profile and the sights:
    whatever records untuned features records all of them.

    Args:
        mirror: see `PanoramaEyes`.
        sectors: see `PanoramaEyes`.
        panorama: see `PanoramaEyes`.
        contrast: see `floor_profile`; six times the noise of the emulated camera's panorama.
    """

    def __init__(
        self,
        mirror: Mirror,
        sectors: Annotated[int, Field(ge=1, le=120)] = 12,
        panorama: PanoramaSize = PanoramaSize(),  # noqa: B008 - a value
        contrast: Annotated[float, Field(ge=1.0, le=255.0)] = 9.0,
    ) -> None:
        super().__init__(mirror, sectors, panorama)
        self.directions = panorama.columns
        self._contrast = contrast

    @property
    def raw_size(self) -> int:
        """Number of untuned features R, the profile and the sights included."""
        return self.size + self.directions + SECTORS * len(CHANNELS)

    def look(self, image: Image) -> Array:
        """Return the untuned features of a picture, the profile of its floor, and its sights."""
        panorama = self.unwrap(image)
        if _SCAN.pays(panorama, LOWEST, self._contrast):
            means, edges, found = _SCAN(panorama, LOWEST, self._contrast)
            profile = profile_of(edges, found, len(panorama), self.mirror)
        else:
            means = panorama.mean(axis=0)
            profile = floor_profile(panorama, self.mirror, self._contrast)
        around = sights(panorama, self.mirror, profile)
        return np.concatenate([self.fields.raw_of(means), profile, around.ravel()])

    def tuned(self, raw: Array) -> Array:
        """Stretch raw means to the tuned range; profile and sights are no features."""
        return super().tuned(raw[..., : self.size])

    def tune(self, raw: Array) -> None:
        """Tune the range of each channel to what was seen."""
        super().tune(raw[..., : self.size])

    def floor(self, raw: Array) -> Array:
        """Return the profile among untuned features, shape (..., directions)."""
        return raw[..., self.size : self.size + self.directions]

    def sights(self, raw: Array) -> Array:
        """Return the sights among untuned features, shape (..., sectors, 5)."""
        around: Array = raw[..., self.size + self.directions :]
        return around.reshape(*raw.shape[:-1], SECTORS, len(CHANNELS))
