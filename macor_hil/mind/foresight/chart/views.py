"""Views, and how like each other they are from wherever the robot looks: by their spectra.

Turning on the spot shifts the ring of what is seen around the robot. Amplitudes of its Fourier
transform stay as they are, and correlation by phases tells the turn.
"""

from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from macor_hil.arrays import Array, Indices

Floats = NDArray[np.float32]
Spectra = NDArray[np.complexfloating[Any, Any]]

_NEAR: Final = (0.1, 1.4)
"""Inverse distances that are told apart."""

_SCALES: Final = (3.3, 2.1)
"""Weights of inverse distances and of colours, which then differ about as much."""

_MEAN: Final = 0.7
"""Weight of means, in which views differ most."""

_HARMONICS: Final = 16


@dataclass(frozen=True, slots=True, eq=False)
class Views:
    """N views.

    Attributes:
        profiles: inverse distance of the floor's end, shape (N, directions).
        colours: of what stands there, from 0 to 1, without its brightness, shape (N, 24, 3).
        noise: of the profiles, over that of eyes that see the floor's end to a millimetre.
    """

    profiles: Floats
    colours: Floats
    noise: float = 1.0

    @classmethod
    def of(cls, profiles: Array, sights: Array) -> Self:
        """Return the views of profiles and of sights, which have shape (N, 24, 5)."""
        colours = sights[..., :3] - sights[..., :3].mean(axis=-1, keepdims=True)
        return cls(profiles.astype(np.float32), colours.astype(np.float32))

    def take(self, numbers: Indices) -> "Views":
        """Return some of them."""
        return Views(self.profiles[numbers], self.colours[numbers], self.noise)

    def spectra(self) -> Spectra:
        """Return the Fourier transforms of what is seen around, shape (N, 4, frequencies)."""
        directions, sectors = self.profiles.shape[1], self.colours.shape[1]
        near = np.clip(self.profiles, *_NEAR)[:, np.newaxis] * _SCALES[0]
        ring = self.colours[:, np.arange(directions) * sectors // directions] * _SCALES[1]
        rings = np.concatenate([near, np.moveaxis(ring, 2, 1)], axis=1)
        spectra = np.fft.rfft(rings, axis=2)
        spectra[:, :, 0] *= _MEAN
        return spectra


def signatures(spectra: Spectra) -> Floats:
    """Return what does not change when the robot turns on the spot, shape (N, features)."""
    amplitudes = np.abs(spectra[..., :_HARMONICS]).astype(np.float32)
    return amplitudes.reshape(len(amplitudes), -1)


def turns(before: Spectra, after: Spectra, directions: int) -> Array:
    """Return by how much the robot turned to the left from one view to another, shape (N,)."""
    likeness = np.fft.irfft((before * after.conj()).sum(axis=1), n=directions, axis=1)
    turned: Array = -2 * np.pi / directions * likeness.argmax(axis=1)
    return turned
