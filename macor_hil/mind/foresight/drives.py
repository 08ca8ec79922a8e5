"""Hypothetical drives: where sequences of commands lead, as a lattice that is computed once.

A tree of three commands has 3^40 branches; but drives that have come to nearly the same place,
headed the same way, go on alike. Poses that fall into the same square, with the same sum of
turns, are one. Squares and strides grow with the distance: what is far away is decided later.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from macor_hil.arrays import Array, Indices
from macor_hil.commands import COMMANDS
from macor_hil.mind.foresight.motions import moved


class Series(NamedTuple):
    """Strides of the same kind.

    Attributes:
        strides: how many there are, one after the other.
        commands: how many equal commands each has.
        square: side of the squares in heights; 0: only the same place counts as one.
    """

    strides: int
    commands: int
    square: float


SERIES: Final = (Series(6, 1, 0.0), Series(4, 1, 0.16), Series(6, 2, 0.4), Series(5, 4, 0.8))
"""42 commands: a trial's forty, and a little."""

MOST_AHEAD: Final = sum(each.strides * each.commands for each in SERIES)
"""Commands of all of them."""

_SAME: Final = 1e-4
"""Heights within which two places are the same."""


@dataclass(frozen=True, slots=True, eq=False)
class Stride:
    """One step of all hypothetical drives.

    Attributes:
        commands: how many equal ones it has.
        before: commands before it, and half of its own: how far ahead it is on average.
        ways: places after each of its commands, shape (commands, m * n, 2), for n poses that it
            begins at; the first command's n come first.
        ends: pose that each of them leads to, among those of the next stride, shape (m, n).
        poses: how many poses there are after it.
    """

    commands: int
    before: float
    ways: Array
    ends: Indices
    poses: int


def hypothetical_drives(motions: Array, commands: int = MOST_AHEAD) -> list[Stride]:
    """Return all strides of the drives that commands of given motions make possible.

    Args:
        motions: of each command, shape (m, 3).
        commands: how many are looked ahead at most; as many whole strides as they are enough for.
    """
    turns = np.array([np.sign(command.turn) for command in COMMANDS], dtype=np.int64)
    pose, turned = np.zeros((1, 3)), np.zeros(1, dtype=np.int64)
    drives: list[Stride] = []
    ahead = 0
    for strides, each, square in SERIES:
        for _ in range(min(strides, (commands - ahead) // each)):
            at = np.tile(pose, (len(motions), 1))
            motion = np.repeat(motions, len(pose), axis=0)
            way = []
            for _ in range(each):
                at = moved(at, motion)
                way.append(at[:, :2])
            sums = np.tile(turned, len(turns)) + each * np.repeat(turns, len(turned))
            first, ends = _alike(at, sums // each, square or _SAME)
            before = ahead + (each - 1) / 2
            ends = ends.reshape(len(motions), -1)
            drives.append(Stride(each, before, np.stack(way), ends, len(first)))
            pose, turned = at[first], sums[first]
            ahead += each
    return drives


def _alike(poses: Array, turned: Indices, square: float) -> tuple[Indices, Indices]:
    """Return the first of each group of poses that are alike, and the group of each pose."""
    squares = np.floor(poses[:, :2] / square + 0.5).astype(np.int64)
    key = np.column_stack([squares, turned])
    _, first, group = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return first, group.ravel()
