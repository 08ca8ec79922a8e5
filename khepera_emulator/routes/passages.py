"""Free floor made of overlapping rectangles, and the walls all round it. Whole millimetres."""

from collections.abc import Sequence
from typing import NamedTuple

Place = tuple[int, int]


class Passage(NamedTuple):
    """A rectangle of free floor: two opposite corners, in millimetres."""

    x0: int
    y0: int
    x1: int
    y1: int

    def is_near(self, other: "Passage", gap: int) -> bool:
        """Tell whether another one is nearer than a gap, or overlaps."""
        return (
            self.x0 - gap < other.x1
            and other.x0 < self.x1 + gap
            and self.y0 - gap < other.y1
            and other.y0 < self.y1 + gap
        )


def faces(passages: Sequence[Passage]) -> list[list[Place]]:
    """Return the borders of all floor that a rectangle covers, as closed lines.

    The floor is to the left of each. The first one goes round everything; others go round what
    stands in the midst of it.
    """
    xs = sorted({x for each in passages for x in (each.x0, each.x1)})
    ys = sorted({y for each in passages for y in (each.y0, each.y1)})
    squares = {
        (i, j)
        for i, x in enumerate(xs)
        for j, y in enumerate(ys)
        if any(each.x0 <= x < each.x1 and each.y0 <= y < each.y1 for each in passages)
    }
    follows: dict[Place, Place] = {}
    for i, j in squares:
        corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        beside = [(i, j - 1), (i + 1, j), (i, j + 1), (i - 1, j)]
        for k, neighbour in enumerate(beside):
            if neighbour not in squares:
                follows[corners[k]] = corners[(k + 1) % 4]
    lines = []
    while follows:
        line = [min(follows)]
        while (after := follows.pop(line[-1], None)) is not None:
            line.append(after)
        lines.append(_straightened([(xs[i], ys[j]) for i, j in line]))
    return lines


def walls(line: list[Place], thickness: int) -> list[Place]:
    """Return the middle line of the wall whose face is a closed line, floor to its left."""
    half = thickness // 2
    around = [line[-2], *line]
    middle = []
    for (x0, y0), (x, y), (x1, y1) in zip(around, line, line[1:], strict=False):
        # away from the floor: to the right of the faces before and after the corner
        middle.append(
            (x + half * (_sign(y - y0) + _sign(y1 - y)), y - half * (_sign(x - x0) + _sign(x1 - x)))
        )
    return [*middle, middle[0]]


def _straightened(line: list[Place]) -> list[Place]:
    """Drop the places of a closed line in which it goes straight on."""
    line = line[:-1]
    around = [line[-1], *line, line[0]]
    kept = [
        b
        for a, b, c in zip(around, around[1:], around[2:], strict=False)
        if (a[0] == b[0]) != (b[0] == c[0])
    ]
    return [*kept, kept[0]]


def _sign(value: int) -> int:
    return (value > 0) - (value < 0)
