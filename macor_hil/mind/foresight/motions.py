"""The motion of each command, learned by matching profiles seen before and after it."""

from typing import Final, NamedTuple, Self

import numpy as np

from macor_hil.arrays import Array, Indices
from macor_hil.mind.eyes.floor_profile import azimuths

LEAST: Final = 30
"""Experiences of a command that are needed, without a collision."""

_MOST: Final = 400
_ROUNDS: Final = 25
_TINY: Final = 1e-3
"""By which a motion is changed to see what that changes."""

_NEAR: Final = (0.15, 1.5)
"""Inverse distances that are measured well enough."""


def moved(pose: Array, motion: Array) -> Array:
    """Return poses after motions, all of shape (..., 3)."""
    x, y, heading = pose[..., 0], pose[..., 1], pose[..., 2]
    c, s = np.cos(heading), np.sin(heading)
    return np.stack(
        [
            x + c * motion[..., 0] - s * motion[..., 1],
            y + s * motion[..., 0] + c * motion[..., 1],
            heading + motion[..., 2],
        ],
        axis=-1,
    )


def wrapped(angles: Array) -> Array:
    """Return angles in -pi to pi, radians."""
    inside: Array = (angles + np.pi) % (2 * np.pi) - np.pi
    return inside


def learned_motion(before: Array, after: Array) -> Array | None:
    """Return the motion that explains what was seen, shape (3,); None: nothing does.

    Gauss-Newton with weights that fall for what does not fit: what was hidden before the motion, or
    is after it.

    Args:
        before: profiles of frames, shape (T, directions).
        after: those of the frames that followed, the same shape.
    """
    if len(before) < LEAST:
        return None
    view = _View.of(before[-_MOST:], after[-_MOST:])
    motion = np.zeros(3)
    for _ in range(_ROUNDS):
        off = view.mismatch(motion)
        steps = [(view.mismatch(motion + d) - off) / _TINY for d in _TINY * np.eye(3)]
        good = np.isfinite([off, *steps]).all(axis=0)
        if not good.any():
            return None
        slopes, off = np.stack([step[good] for step in steps], axis=1), off[good]
        spread = 1.4826 * np.median(np.abs(off)) + 1e-4
        weight = 1.0 / (1.0 + (off / (2 * spread)) ** 2)
        normal = (slopes * weight[:, None]).T @ slopes + 1e-6 * np.eye(3)
        change = -np.linalg.solve(normal, slopes.T @ (weight * off))
        motion += change * min(1.0, 0.3 / max(np.abs(change).max(), 1e-9))
        if np.abs(change).max() < 1e-5:
            break
    return motion


class _View(NamedTuple):
    """The places that frames show well enough before a motion, one after the other.

    Attributes:
        x, y: of each place, shape (K,).
        first: of the frame that shows it, in `after`.
        columns: directions of a frame.
        after: profiles of the frames that followed, one after the other.
    """

    x: Array
    y: Array
    first: Indices
    columns: int
    after: Array

    @classmethod
    def of(cls, before: Array, after: Array) -> Self:
        """Return the places of profiles, both of shape (T, directions)."""
        columns = before.shape[1]
        directions = azimuths(columns)
        near, nearest = _NEAR
        frame, direction = np.nonzero((before > near) & (before < nearest))
        profile = before[frame, direction]
        x = np.cos(directions)[direction] / profile
        y = np.sin(directions)[direction] / profile
        return cls(x, y, frame * columns, columns, after.ravel())

    def mismatch(self, motion: Array) -> Array:
        """Return what is seen after a motion less what should be; NaN where that cannot be told."""
        columns = self.columns
        x, y = self.x - motion[0], self.y - motion[1]
        c, s = np.cos(motion[2]), np.sin(motion[2])
        x, y = c * x + s * y, c * y - s * x
        place = (np.pi - np.arctan2(y, x)) / (2 * np.pi) * columns - 0.5
        column = np.floor(place)
        share = place - column
        left = column.astype(np.int64) % columns
        right = left + 1
        right[right == columns] = 0
        seen = self.after[self.first + left] * (1 - share) + self.after[self.first + right] * share
        off: Array = seen - 1.0 / np.maximum(np.hypot(x, y), 1e-6)
        off[seen >= _NEAR[1]] = np.nan
        return off
