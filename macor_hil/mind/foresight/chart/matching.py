"""Matches of views: the motion from one to the other, and whether both show the same place."""

from typing import Final

import numpy as np

from macor_hil.arrays import Array, Indices, Mask
from macor_hil.mind.eyes.floor_profile import azimuths
from macor_hil.mind.foresight.chart.views import Floats, Views

_NEAR: Final = (0.06, 1.5)
"""Inverse distances that are measured well enough."""

_EVERY: Final = 3
"""Of the directions, one in so many is enough for a motion."""

_ODD: Final = 0.02
"""Inverse distance off by which a direction counts for little: something hides it from one view."""

_TINY: Final = 1e-3
_LONGEST: Final = 0.3
_PRIOR: Final = 1e-2
"""Keeps what cannot be told, such as the way along a straight wall, as it was guessed."""

_TOLERANCE: Final = (0.006, 0.011)
"""Inverse distance by which views of the same place differ, at no and at unit distance."""

_NOISES: Final = (1.0, 1.5, 2.0, 3.0, 4.0)
_SAME: Final = 0.95
"""Agreement of views before and after a driven command."""

_HIDDEN: Final = 5 / 6
"""Part of the sectors whose colours can be compared, the others may show something else."""


def inverse(motions: Array) -> Array:
    """Return motions back, both of shape (..., 3)."""
    x, y, turn = np.moveaxis(motions, -1, 0)
    c, s = np.cos(turn), np.sin(turn)
    return np.stack([-(c * x + s * y), s * x - c * y, -turn], axis=-1)


def fitted(
    before: Floats, after: Floats, guess: Array, rounds: int = 4, noise: float = 1.0
) -> tuple[Array, Array]:
    """Return the motions that explain what was seen, by Gauss and Newton.

    Args:
        before: profiles, shape (N, directions).
        after: profiles, the same shape.
        guess: motions from which it begins, shape (N, 3).
        rounds: of the fit.
        noise: see `Views`.

    Returns:
        Motions, shape (N, 3), and how well they are known: the normal matrices, shape (N, 3, 3).
    """
    motion = guess.astype(np.float32)
    normal = np.zeros((len(guess), 3, 3))
    for _ in range(rounds):
        off, good = _mismatch(before, after, motion)
        slopes = []
        for step in _TINY * np.eye(3, dtype=np.float32):
            moved, known = _mismatch(before, after, motion + step)
            slopes.append((moved - off) / _TINY)
            good &= known
        slope = np.where(good[..., None], np.stack(slopes, axis=-1), 0.0)
        off = np.where(good, off, 0.0)
        weighted = slope * (good / (1.0 + (off / (noise * _ODD)) ** 2) ** 2)[..., None]
        across = np.swapaxes(weighted, 1, 2)
        normal = (across @ slope).astype(np.float64)
        wanted = across @ off[..., None]
        change = -np.linalg.solve(normal + _PRIOR * np.eye(3), wanted)[..., 0]
        longest = np.maximum(np.abs(change).max(axis=1, keepdims=True), 1e-9)
        motion += (change * np.minimum(1.0, _LONGEST / longest)).astype(np.float32)
    return motion.astype(np.float64), normal


def agreement(before: Floats, after: Floats, motions: Array, noise: float = 1.0) -> Array:
    """Return the share of the directions that show what a motion makes expect, shape (N,)."""
    there = _share(before, after, motions, noise)
    back = _share(after, before, inverse(motions), noise)
    return np.minimum(there, back)


def noise_of(before: Floats, after: Floats, motions: Array) -> float:
    """Return the least noise at which views agree that known motions lead from one to the other.

    Args:
        before: profiles, shape (N, directions).
        after: profiles, the same shape.
        motions: between them, shape (N, 3).
    """
    for noise in _NOISES:
        if np.median(agreement(before, after, motions, noise)) >= _SAME:
            return noise
    return _NOISES[-1]


def colours_apart(before: Views, after: Views, motions: Array) -> Array:
    """Return how far colours around differ after motions, sum over channels, shape (N,).

    The few sectors that differ most may show what is hidden from one of both, and do not count; the
    next one counts by a quarter if that is more than the mean.
    """
    sectors = before.colours.shape[1]
    place = np.arange(sectors) + motions[:, 2:] * (sectors / (2 * np.pi))
    one = np.floor(place).astype(np.int64)
    share, view = (place - one)[..., None], np.arange(len(motions))[:, None]
    here, next_one = (after.colours[view, (one + k) % sectors] for k in (0, 1))
    apart = np.abs(before.colours - here * (1 - share) - next_one * share).sum(axis=-1)
    apart.sort(axis=1)
    compared = int(sectors * _HIDDEN)
    different: Array = np.maximum(apart[:, :compared].mean(axis=1), apart[:, compared] / 4)
    return different


def _mismatch(before: Floats, after: Floats, motion: Floats) -> tuple[Floats, Mask]:
    """Return what is seen less what should be in some directions, and where that can be told."""
    view, column, share, expected, told = _expected(before, motion, _EVERY)
    columns = before.shape[1]
    seen = after[view, column % columns] * (1 - share)
    seen += after[view, (column + 1) % columns] * share
    return seen - expected, told & (seen < _NEAR[1])


def _share(before: Floats, after: Floats, motions: Array, noise: float) -> Array:
    view, column, _, expected, _ = _expected(before, motions.astype(np.float32), 1)
    columns = before.shape[1]
    one, other = after[view, column % columns], after[view, (column + 1) % columns]
    told = (before < _NEAR[1]) & (expected < _NEAR[1])
    tolerance = noise * (_TOLERANCE[0] + _TOLERANCE[1] * expected)
    low, high = np.minimum(one, other) - tolerance, np.maximum(one, other) + tolerance
    right = told & (expected > low) & (expected < high)
    share: Array = right.sum(axis=1) / np.maximum(told.sum(axis=1), before.shape[1] / 3)
    return share


def _expected(
    before: Floats, motion: Floats, every: int
) -> tuple[Indices, Indices, Floats, Floats, Mask]:
    """Return the columns in which ends of the floor should be seen after motions.

    Returns:
        Number of the view, column and share of the next one, inverse distance expected there, and
        whether the end is seen well enough before.
    """
    columns = before.shape[1]
    directions = azimuths(columns)[::every].astype(np.float32)
    near = before[:, ::every]
    x = np.cos(directions) / near - motion[:, :1]
    y = np.sin(directions) / near - motion[:, 1:2]
    bearing = np.arctan2(y, x) - motion[:, 2:]
    place = (np.pi - bearing) * np.float32(columns / (2 * np.pi)) - np.float32(0.5)
    column: Floats = np.floor(place)
    expected = np.asarray(1.0 / np.maximum(np.sqrt(x * x + y * y), 1e-6), np.float32)
    told: Mask = (near > _NEAR[0]) & (near < _NEAR[1])
    view: Indices = np.arange(len(before), dtype=np.int64)[:, None]
    share: Floats = place - column
    return view, column.astype(np.int64), share, expected, told
