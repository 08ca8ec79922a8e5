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
        self._rows: list[Any] = []  # those to come, the last one first

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Any:
        """Return the next row, as a list."""
        rows = self._rows
        if not rows:
            self._take(self._draw())
            rows = self._rows
        return rows.pop()

    def ahead(self, least: int) -> Numbers:
        """Return the rows to come, so many at least; they stay where they are."""
        while self._block is None or len(self._rows) < least:
            left = len(self._rows)
            block = self._draw()
            if left and self._block is not None:
                block = np.concatenate([self._block[-left:], block])
            self._take(block)
        return self._block[len(self._block) - len(self._rows) :]

    def skip(self, count: int) -> None:
        """Let go of the next rows, which were taken from what is ahead."""
        if count:
            del self._rows[-count:]

    def _take(self, block: Numbers) -> None:
        self._block = block
        self._rows = block[::-1].tolist()
