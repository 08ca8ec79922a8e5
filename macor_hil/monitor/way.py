"""The way of a robot as pieces that stay as they are, so that only its end is drawn anew."""

from collections import deque
from collections.abc import Iterator
from math import hypot
from typing import Final

from khepera_protocol.zenoh.payloads import Pose

PIECE: Final = 64
"""Points of a piece; the last one is the first of the next."""

_PIECES: Final = 80
"""Pieces that are kept: ten metres and more."""

_STEP: Final = 0.002
"""Metres that the robot moves before its way gets another point."""

_JUMP: Final = 0.05
"""Metres between two poses beyond which the robot was put there."""


class Way:
    """The places where a robot was, oldest first, since it was put down.

    Attributes:
        pieces: the points in pieces of at most `PIECE`.
        first: number of the first piece; it never falls, whatever is forgotten.
    """

    def __init__(self) -> None:
        self.pieces: deque[list[Pose]] = deque()
        self.first = 0

    def __bool__(self) -> bool:
        """Tell whether there is any point."""
        return bool(self.pieces)

    def __iter__(self) -> Iterator[Pose]:
        """Give the points, oldest first."""
        for number, piece in enumerate(self.pieces):
            yield from piece[1:] if number else piece

    @property
    def last(self) -> Pose:
        """The newest point; there must be one."""
        return self.pieces[-1][-1]

    def add(self, pose: Pose) -> None:
        """Add a pose, if it is far enough from the last one; begin anew where it is too far."""
        if self.pieces:
            apart = hypot(self.last.x - pose.x, self.last.y - pose.y)
            if apart > _JUMP:
                self.first += len(self.pieces)
                self.pieces.clear()
            elif apart < _STEP:
                return
        if not self.pieces:
            self.pieces.append([pose])
            return
        if len(self.pieces[-1]) == PIECE:
            self.pieces.append([self.last])
        self.pieces[-1].append(pose)
        if len(self.pieces) > _PIECES:
            self.pieces.popleft()
            self.first += 1
