"""The chart of a training: the pose of every view in one frame of reference."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from macor_hil.arrays import Array, Indices, Mask
from macor_hil.mind.foresight.chart.links import Links, driven, matches, relative
from macor_hil.mind.foresight.chart.relaxing import relaxed, spread_out
from macor_hil.mind.foresight.chart.views import Views
from macor_hil.mind.foresight.motions import moved

_EVERY: Final = 5
"""Of the views of a drive, one in so many is matched with others."""


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Poses of views.

    Attributes:
        poses: of each view of the training, NaN where it is not known, shape (T, 3).
        matched: numbers of those that were matched with others.
    """

    poses: Array
    matched: Indices

    @property
    def known(self) -> Indices:
        """Numbers of the views whose poses are known."""
        return np.flatnonzero(np.isfinite(self.poses[:, 0]))


def charted(views: Views, commands: Indices, collided: Mask, motions: Array) -> Chart:
    """Return the chart of a training; what cannot be linked with its greatest part is not in it.

    Args:
        views: T of them.
        commands: index of the command that led to each view, negative where none did, shape (T,).
        collided: whether it ended in a collision, and so nobody knows where; shape (T,).
        motions: of the commands, shape (m, 3).
    """
    drives = np.cumsum(commands < 0, dtype=np.int64)
    way = _driven_poses(commands, motions)
    number = np.arange(len(commands))
    since = number - np.maximum.accumulate(np.where(commands < 0, number, 0))
    chosen = np.flatnonzero((since % _EVERY == 0) & ~collided)
    links = _joined(
        matches(views.take(chosen), drives[chosen]), driven(way[chosen], drives[chosen])
    )
    pose, part = spread_out(len(chosen), links)
    inside = part == np.bincount(part, minlength=1).argmax()
    renamed = np.cumsum(inside) - 1
    links = links.take(np.flatnonzero(inside[links.begin]))
    links = links._replace(begin=renamed[links.begin], end=renamed[links.end])
    matched, pose = chosen[inside], relaxed(pose[inside], links)
    return Chart(_all_poses(matched, pose, way, drives, collided), matched)


def _joined(one: Links, other: Links) -> Links:
    return Links(
        np.concatenate([one.begin, other.begin]),
        np.concatenate([one.end, other.end]),
        np.concatenate([one.motion, other.motion]),
        np.concatenate([one.weight, other.weight]),
    )


def _driven_poses(commands: Indices, motions: Array) -> Array:
    """Return poses from the beginning of each view's drive, shape (T, 3)."""
    poses = np.zeros((len(commands), 3))
    for number, command in enumerate(commands.tolist()):
        if command >= 0 and number:
            poses[number] = moved(poses[number - 1], motions[command])
    return poses


def _all_poses(matched: Indices, pose: Array, way: Array, drives: Indices, collided: Mask) -> Array:
    """Return poses of all views, each from the last one before it in its drive that has one."""
    poses = np.full((len(way), 3), np.nan)
    last = np.searchsorted(matched, np.arange(len(way)), side="right") - 1
    known = (last >= 0) & (drives[matched[last]] == drives) & ~collided
    since = relative(way[matched[last[known]]], way[known])
    poses[known] = moved(pose[last[known]], since)
    return poses
