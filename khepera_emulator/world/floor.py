"""The floor's brightness at a point: its colour, and what is painted on it."""

from itertools import pairwise

from khepera_emulator.arenas.arena import Arena, Point


def floor_grey(arena: Arena, x: float, y: float) -> float:
    """Return the grey value, 0 black to 1 white, of the floor at a point in metres."""
    colour = arena.floor
    for paint in arena.paint:
        half = paint.width / 2
        if any(_distance(x, y, a, b) <= half for a, b in pairwise(paint.points)):
            colour = paint.colour
    return sum(colour) / 3


def _distance(x: float, y: float, start: Point, end: Point) -> float:
    (ax, ay), (bx, by) = start, end
    ux, uy = bx - ax, by - ay
    length = ux * ux + uy * uy
    share = ((x - ax) * ux + (y - ay) * uy) / length
    share = min(max(share, 0.0), 1.0)
    dx, dy = x - ax - share * ux, y - ay - share * uy
    return float((dx * dx + dy * dy) ** 0.5)
