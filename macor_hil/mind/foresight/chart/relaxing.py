"""Poses of views from the links between them: a tree of links first, then all links at once.

The second step is a pose graph's (Lu and Milios 1997), in two linear problems: headings, then
places. Links that do not fit count for little in the next round. Conjugate gradients solve both.
"""

from collections.abc import Callable
from heapq import heappop, heappush
from typing import Final

import numpy as np

from macor_hil.arrays import Array, Indices
from macor_hil.mind.foresight.chart.links import Links, both_ways
from macor_hil.mind.foresight.motions import moved, wrapped

_ROUNDS: Final = 4
_STEPS: Final = 120
_EXACT: Final = 1e-8
_ODD: Final = 3.0
"""Deviations by which a link that does not fit is off."""

_TURN: Final = 0.02
"""Error of the turn of a link, in radians."""

_WEAKEST: Final = 1e-3


def spread_out(views: int, links: Links) -> tuple[Array, Indices]:
    """Return the pose of each view by the best known links, and the part that it belongs to.

    Args:
        views: how many there are.
        links: between them.

    Returns:
        Poses, shape (views, 3), each from the first view of its part; and numbers of parts.
    """
    ways = both_ways(links)
    weakest = np.maximum(np.linalg.eigvalsh(ways.weight)[:, 0], _WEAKEST)
    error = (1.0 / np.sqrt(weakest)).tolist()
    order = np.argsort(ways.begin, kind="stable")
    firsts = np.searchsorted(ways.begin[order], np.arange(views + 1)).tolist()
    ends = ways.end.tolist()
    part, pose = np.full(views, -1), np.zeros((views, 3))
    for first in range(views):
        if part[first] >= 0:
            continue
        number = part.max(initial=-1) + 1
        # links to what is not placed yet, the best one on top
        edge: list[tuple[float, int, int]] = [(0.0, first, -1)]
        while edge:
            _, view, link = heappop(edge)
            if part[view] >= 0:
                continue
            part[view] = number
            if link >= 0:
                pose[view] = moved(pose[ways.begin[link]], ways.motion[link])
            for other in order[firsts[view] : firsts[view + 1]].tolist():
                if part[ends[other]] < 0:
                    heappush(edge, (error[other], ends[other], other))
    return pose, part


def relaxed(poses: Array, links: Links) -> Array:
    """Return the poses that fit all links best, both of shape (N, 3)."""
    begin, end, motion, weight = links
    heading, place = poses[:, 2], poses[:, :2]
    trust = np.ones(len(begin))
    for _ in range(_ROUNDS):
        turn = wrapped(motion[:, 2] - heading[end] + heading[begin])
        even = np.broadcast_to(np.eye(1), (len(begin), 1, 1)) * trust[:, None, None]
        change = _solved(np.zeros((len(poses), 1)), begin, end, turn[:, None], even)
        heading = heading + change[:, 0]
        c, s = np.cos(heading[begin]), np.sin(heading[begin])
        rotation = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
        way = (rotation @ motion[:, :2, None])[..., 0]
        turned = rotation @ weight @ np.swapaxes(rotation, 1, 2)
        place = _solved(place, begin, end, way, turned * trust[:, None, None])
        off = place[end] - place[begin] - way
        far = np.sqrt((off * (turned @ off[..., None])[..., 0]).sum(axis=1))
        far += np.abs(wrapped(heading[end] - heading[begin] - motion[:, 2])) / _TURN
        trust = 1.0 / (1.0 + (far / _ODD) ** 2) ** 2
    return np.column_stack([place, heading])


def _solved(x: Array, begin: Indices, end: Indices, apart: Array, weight: Array) -> Array:
    """Return x of shape (N, k) whose differences fit best, by conjugate gradients from an x."""

    def gathered(pull: Array) -> Array:
        columns = [
            np.bincount(end, one, len(x)) - np.bincount(begin, one, len(x)) for one in pull.T
        ]
        return np.stack(columns, axis=1)

    def times(x: Array) -> Array:
        return gathered((weight @ (x[end] - x[begin])[..., None])[..., 0]) + 1e-9 * x

    own = np.diagonal(weight, axis1=1, axis2=2)
    diagonal = np.stack(
        [np.bincount(begin, w, len(x)) + np.bincount(end, w, len(x)) for w in own.T], axis=1
    )
    return _conjugate(times, gathered((weight @ apart[..., None])[..., 0]), x, diagonal + 1e-6)


def _conjugate(times: Callable[[Array], Array], wanted: Array, x: Array, diagonal: Array) -> Array:
    rest = wanted - times(x)
    step = better = rest / diagonal
    size = first = float((rest * better).sum())
    for _ in range(_STEPS):
        if size <= _EXACT * max(first, 1e-12):
            break
        along = times(step)
        share = size / float((step * along).sum())
        x, rest = x + share * step, rest - share * along
        better = rest / diagonal
        size, before = float((rest * better).sum()), size
        step = better + size / before * step
    return x
