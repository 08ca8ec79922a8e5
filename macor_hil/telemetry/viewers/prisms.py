"""Walls and things as upright prisms, in triangles; an arena from above does not tell heights."""

from collections.abc import Iterator, Sequence
from typing import Final

HEIGHT: Final = 0.05
"""Metres that walls are drawn high."""

Place = tuple[float, float, float]


def prism(corners: Sequence[tuple[float, float]]) -> Iterator[Place]:
    """Yield the corners of triangles, three each: the sides of a convex solid, and its top.

    Args:
        corners: of the solid on the floor, metres.
    """
    for k, low in enumerate(corners):
        near = corners[(k + 1) % len(corners)]
        a, b, c, d = (*low, 0.0), (*near, 0.0), (*near, HEIGHT), (*low, HEIGHT)
        yield from (a, b, c, a, c, d)
    for k in range(1, len(corners) - 1):
        yield from ((*corners[i], HEIGHT) for i in (0, k, k + 1))
