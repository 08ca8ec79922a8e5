"""The robot's whereabouts in a chart: by what it sees, and by where it was."""

from typing import Final

import numpy as np

from macor_hil.arrays import Array, Indices
from macor_hil.mind.foresight.chart.chart import Chart
from macor_hil.mind.foresight.chart.links import nearest, relative
from macor_hil.mind.foresight.chart.matching import agreement, colours_apart, fitted
from macor_hil.mind.foresight.chart.views import Views, signatures, turns
from macor_hil.mind.foresight.motions import moved, wrapped

_CANDIDATES: Final = 8
"""Places that look like the one that is looked for."""

_BESIDE: Final = 3
"""Places beside the one that was foreseen."""

_CLOSE: Final = 0.8
_TURNED: Final = 0.5
"""Heights and radians by which it may be off."""

_AGREE: Final = 0.85
_COLOURS: Final = 0.12
"""Least agreement, and greatest difference of colours, of a place that is recognised."""


class Whereabouts:
    """Tells where in a chart a view was taken.

    Args:
        chart: of a training.
        views: all views of that training.
    """

    def __init__(self, chart: Chart, views: Views) -> None:
        self._poses = chart.poses[chart.matched]
        self._views = views.take(chart.matched)
        self._spectra = self._views.spectra()
        self._signatures = signatures(self._spectra)

    def find(self, seen: Views, foreseen: Array | None = None) -> Array | None:
        """Return the pose of a view, shape (3,); None: it is no place of the chart.

        Args:
            seen: one view.
            foreseen: pose that it should have, shape (3,); None: nothing is known of it.
        """
        if foreseen is not None and (pose := self._near(seen, foreseen)) is not None:
            return pose
        return self._anywhere(seen)

    def _near(self, seen: Views, foreseen: Array) -> Array | None:
        away = np.hypot(*(self._poses[:, :2] - foreseen[:2]).T)
        beside = np.argsort(away)[:_BESIDE]
        beside = beside[away[beside] < _CLOSE]
        if not len(beside):
            return None
        there = np.broadcast_to(foreseen, (len(beside), 3))
        pose = self._matched(seen, beside, relative(self._poses[beside], there))
        if pose is None or np.hypot(*(pose - foreseen)[:2]) > _CLOSE:
            return None
        return pose if np.abs(wrapped(pose[2] - foreseen[2])) < _TURNED else None

    def _anywhere(self, seen: Views) -> Array | None:
        if len(self._poses) <= _CANDIDATES:
            return None
        spectra = seen.spectra()
        alike = nearest(signatures(spectra), self._signatures, _CANDIDATES)[0]
        guess = np.zeros((len(alike), 3))
        ours = np.broadcast_to(spectra, self._spectra[alike].shape)
        guess[:, 2] = turns(self._spectra[alike], ours, seen.profiles.shape[1])
        return self._matched(seen, alike, guess)

    def _matched(self, seen: Views, places: Indices, guess: Array) -> Array | None:
        """Return the pose by the best match with one of some places."""
        known, ours = self._views.take(places), seen.take(np.zeros(len(places), np.int64))
        motion, _ = fitted(known.profiles, ours.profiles, guess, noise=known.noise)
        agree = agreement(known.profiles, ours.profiles, motion, known.noise)
        apart = colours_apart(known, ours, motion)
        fits = np.where((agree > _AGREE) & (apart < _COLOURS), agree - apart, -np.inf)
        best = int(np.argmax(fits))
        pose: Array = moved(self._poses[places[best]], motion[best])
        return pose if np.isfinite(fits[best]) else None
