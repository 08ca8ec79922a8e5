"""Random numbers that are drawn in blocks, because single draws are slow."""

from collections.abc import Callable
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


class Drawn:
    """Endless rows of random numbers, taken one by one or as an array of those to come.

    Args:
        draw: draws the next block, shape (K, ...).
    """

    def __init__(self, draw: Callable[[], Numbers]) -> None:
        self._draw = draw
        self._block: Numbers | None = None
        self._rows: list[Any] | None = None  # of the block, where they are taken one by one
        self._taken = 0

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Any:
        """Return the next row, as a list."""
        rows, k = self._rows, self._taken
        if rows is None or k == len(rows):
            self._block, self._taken = self.ahead(1), 0
            self._rows = rows = self._block.tolist()
            k = 0
        self._taken = k + 1
        return rows[k]

    @property
    def left(self) -> int:
        """Number of rows that are drawn and were not taken."""
        return 0 if self._block is None else len(self._block) - self._taken

    def ahead(self, least: int) -> Numbers:
        """Return the rows to come, so many at least; they stay where they are."""
        while self._block is None or self.left < least:
            block = self._draw()
            if self._block is not None and self.left:
                block = np.concatenate([self._block[self._taken :], block])
            self._block, self._rows, self._taken = block, None, 0
        return self._block[self._taken :]

    def skip(self, count: int) -> None:
        """Let go of the next rows, which were taken from what is ahead."""
        self._taken += count
