"""The worth of every pose: reward that is to be had from there, by value iteration.

    V(pose) = max over commands of p (R + g V(pose after it)),

with p the chance to get through, R the reward at the place that it leads to, and g what a command
costs; after a goal that ends the drive nothing follows, and V's share in the sum is 1 - R.
"""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from macor_hil.arrays import Array, Indices
from macor_hil.mind.foresight.chart.ground import CELL, Ground
from macor_hil.mind.foresight.chart.views import Floats
from macor_hil.mind.foresight.collisions import Curve
from macor_hil.mind.foresight.motions import moved

HEADINGS: Final = 30
"""Headings that are told apart: each turn of the paper's commands leads from one to the next."""

_SWEEPS: Final = 600
_SETTLED: Final = 1e-4

_VAGUE: Final = 0.06
"""Heights: error of places in a chart, which adds to that of the curve of collisions."""


@dataclass(frozen=True, slots=True, eq=False)
class Worth:
    """Values of poses.

    Attributes:
        ground: under them.
        reward: of places, shape (rows, columns).
        ends: whether a drive ends where the reward is.
        values: shape (HEADINGS, rows, columns).
    """

    ground: Ground
    reward: Floats
    ends: bool
    values: Floats

    def at(self, poses: Array) -> Floats:
        """Return the values of poses of shape (n, 3), between those of the nearest cells."""
        heading = poses[:, 2] * (HEADINGS / (2 * np.pi))
        one = np.floor(heading).astype(np.int64)
        share = (heading - one).astype(np.float32)
        here, next_one = (
            _between(self.values, (one + k) % HEADINGS, self.ground.places(poses)) for k in (0, 1)
        )
        return here * (1 - share) + next_one * share

    def reward_at(self, poses: Array) -> Floats:
        """Return the reward of poses of shape (n, 3)."""
        return _between(
            self.reward[np.newaxis], np.zeros(len(poses), np.int64), self.ground.places(poses)
        )


def worth_of(
    ground: Ground, reward: Floats, motions: Array, curve: Curve, keeps: float, *, ends: bool
) -> Worth:
    """Return the worth of all poses.

    Args:
        ground: under them.
        reward: of places, 0 to 1, shape (rows, columns).
        motions: of the commands, shape (m, 3).
        curve: chance of a collision.
        keeps: g, the share of a reward that a command leaves of it.
        ends: whether a drive ends where the reward is.
    """
    rows, columns = reward.shape
    vague = Curve(curve.reach, curve.vague + _VAGUE, curve.grows)
    survival = vague.survival(ground.clearance.astype(np.float64), 0.0).astype(np.float32)
    turns = np.rint(motions[:, 2] * (HEADINGS / (2 * np.pi))).astype(np.int64)
    heading = np.arange(HEADINGS) * (2 * np.pi / HEADINGS)
    ways, chances, earns = [], [], []
    for motion, turn in zip(motions, turns.tolist(), strict=True):
        for number in range(HEADINGS):
            pose = np.array([0.0, 0.0, heading[number]])
            way = moved(pose, motion)[:2] / CELL
            halfway = moved(pose, motion / 2)[:2] / CELL
            ways.append((way, (number + turn) % HEADINGS))
            through = np.minimum(_shifted(survival, way), _shifted(survival, halfway))
            chances.append(through)
            earns.append(_shifted(reward, way))
    values = np.zeros((HEADINGS, rows, columns), np.float32)
    after = [
        keeps * chance * ((1 - r) if ends else 1.0)
        for chance, r in zip(chances, earns, strict=True)
    ]
    first = [chance * r for chance, r in zip(chances, earns, strict=True)]
    for _ in range(_SWEEPS):
        new = np.zeros_like(values)
        for k, (way, to) in enumerate(ways):
            number = k % HEADINGS
            earned = first[k] + after[k] * _shifted(values[to], way)
            np.maximum(new[number], earned, out=new[number])
        change = float(np.abs(new - values).max())
        values = new
        if change < _SETTLED:
            break
    return Worth(ground, reward, ends, values)


def _shifted(raster: Floats, way: Array) -> Floats:
    """Return a raster as it is found a way from each cell; 0 beyond its sides."""
    rows, columns = raster.shape
    there = np.array([[1.0, 0.0, way[0]], [0.0, 1.0, way[1]]])
    shifted = cv2.warpAffine(raster, there, (columns, rows), flags=1 | cv2.WARP_INVERSE_MAP)
    return np.asarray(shifted, np.float32)


def _between(layers: Floats, layer: Indices, places: Array) -> Floats:
    """Return values between cells: layers of shape (k, rows, columns), places (column, row)."""
    _, rows, columns = layers.shape
    x = np.clip(places[:, 0], 0, columns - 1.001)
    y = np.clip(places[:, 1], 0, rows - 1.001)
    column, row = x.astype(np.int64), y.astype(np.int64)
    right, down = (x - column).astype(np.float32), (y - row).astype(np.float32)
    above = layers[layer, row, column] * (1 - right) + layers[layer, row, column + 1] * right
    below = (
        layers[layer, row + 1, column] * (1 - right) + layers[layer, row + 1, column + 1] * right
    )
    return np.asarray(above * (1 - down) + below * down, np.float32)
