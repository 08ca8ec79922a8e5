"""Links between views: driven commands, and matches of views that show the same place."""

from typing import Final, NamedTuple

import numpy as np

from macor_hil.arrays import Array, Indices
from macor_hil.mind.foresight.chart.matching import agreement, colours_apart, fitted, inverse
from macor_hil.mind.foresight.chart.views import Floats, Views, signatures, turns


class _Test(NamedTuple):
    """A test of whether two views show the same place.

    Attributes:
        alike: views that each one is compared with.
        agree: least agreement of profiles.
        colours: greatest difference of colours.
        apart: heights between them; from farther away too much is hidden from one of both.
    """

    alike: int
    agree: float
    colours: float
    apart: float


_CLEAR: Final = _Test(alike=7, agree=0.94, colours=0.09, apart=0.6)
"""For exact profiles: among 15,000 pairs in a maze none of another place was within both."""

_NOISY: Final = _Test(alike=12, agree=0.97, colours=0.035, apart=0.35)
"""For others, which agree more easily."""

_MATCHED: Final = 0.09
"""Error of the inverse distances of a match; those of neighbouring directions are much alike."""

_DRIVEN: Final = 0.03
"""Error of driven commands, in heights."""

_PAIRS: Final = 500
"""Views that are compared with all others at once."""


class Links(NamedTuple):
    """Links.

    Attributes:
        begin, end: numbers of the views, shape (E,).
        motion: from one to the other, shape (E, 3).
        weight: inverse covariance of the way, shape (E, 2, 2).
    """

    begin: Indices
    end: Indices
    motion: Array
    weight: Array

    def take(self, numbers: Indices) -> "Links":
        """Return some of them."""
        begin, end, motion, weight = self
        return Links(begin[numbers], end[numbers], motion[numbers], weight[numbers])


def matches(views: Views, drives: Indices) -> Links:
    """Return links between views of different drives that show the same place.

    Args:
        views: N of them.
        drives: number of the drive of each view, shape (N,).
    """
    spectra = views.spectra()
    test = _CLEAR if views.noise < 2.0 else _NOISY
    begin, end = _alike(signatures(spectra), drives, test.alike)
    guess = np.zeros((len(begin), 3))
    guess[:, 2] = turns(spectra[begin], spectra[end], views.profiles.shape[1])
    before, after = views.take(begin), views.take(end)
    motion, normal = fitted(before.profiles, after.profiles, guess, noise=views.noise)
    known = (agreement(before.profiles, after.profiles, motion, views.noise) > test.agree) & (
        colours_apart(before, after, motion) < test.colours
    )
    good = np.flatnonzero(known & (np.hypot(motion[:, 0], motion[:, 1]) < test.apart))
    weight = normal[good, :2, :2] / _MATCHED**2
    return Links(begin[good], end[good], motion[good], weight)


def driven(poses: Array, drives: Indices) -> Links:
    """Return links between one view and the next of the same drive.

    Args:
        poses: of the views, from the beginning of their drive, shape (N, 3).
        drives: see `matches`.
    """
    begin = np.flatnonzero(drives[1:] == drives[:-1])
    motion = relative(poses[begin], poses[begin + 1])
    weight = np.broadcast_to(np.eye(2) / _DRIVEN**2, (len(begin), 2, 2))
    return Links(begin, begin + 1, motion, weight)


def relative(before: Array, after: Array) -> Array:
    """Return the motions from poses to others, all of shape (N, 3)."""
    apart = after - before
    c, s = np.cos(before[:, 2]), np.sin(before[:, 2])
    ahead, left = c * apart[:, 0] + s * apart[:, 1], c * apart[:, 1] - s * apart[:, 0]
    return np.stack([ahead, left, apart[:, 2]], axis=1)


def both_ways(links: Links) -> Links:
    """Return links with those back, which come second."""
    return Links(
        np.concatenate([links.begin, links.end]),
        np.concatenate([links.end, links.begin]),
        np.concatenate([links.motion, inverse(links.motion)]),
        np.concatenate([links.weight, links.weight]),
    )


def nearest(signature: Floats, known: Floats, count: int, far: Indices | None = None) -> Indices:
    """Return the nearest of known signatures to each one, shape (n, count).

    Args:
        signature: shape (n, features).
        known: shape (N, features), N > count.
        count: how many.
        far: 1 for those that are not to be found, shape (n, N); None: none.
    """
    distance = (known * known).sum(axis=1) - 2 * signature @ known.T
    if far is not None:
        distance[far] = np.inf
    found: Indices = np.argpartition(distance, count, axis=1)[:, :count]
    return found


def _alike(signature: Floats, drives: Indices, most: int) -> tuple[Indices, Indices]:
    """Return pairs of views of different drives that look alike."""
    count = min(most, len(signature) - 1)
    if count < 1:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    found = [
        nearest(
            signature[first : first + _PAIRS],
            signature,
            count,
            drives[first : first + _PAIRS, None] == drives,
        )
        for first in range(0, len(signature), _PAIRS)
    ]
    pairs = np.stack([np.repeat(np.arange(len(signature)), count), np.concatenate(found).ravel()])
    begin, end = np.unique(np.sort(pairs, axis=0), axis=1)
    other = drives[begin] != drives[end]
    return begin[other], end[other]
