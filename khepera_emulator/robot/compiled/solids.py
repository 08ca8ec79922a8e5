"""Distances to solids, compiled; `world.solids` and `world.floor_plan` are the plain form."""

from math import inf, sqrt
from typing import Any

from khepera_protocol.system.compiled import compiled, part

_GLANCE = 1e-200
_SPLIT = 2.0**27 + 1.0


@compiled
def hypot(a: float, b: float) -> float:
    """Return sqrt(a^2 + b^2) to the last bit, as `math.hypot` does, which C's is not always."""
    a, b = abs(a), abs(b)
    most = max(a, b)
    if most == 0.0:
        return 0.0
    scale = 1.0
    if not 1e-100 < most < 1e100:  # so that no square leaves the range of numbers
        scale = 2.0**-600 if most > 1.0 else 2.0**600
        a, b = a * scale, b * scale
    # squares and their rounding errors, summed (Dekker), and one step of Newton's method
    high, low = _square(a)
    high2, low2 = _square(b)
    total = high + high2
    larger, smaller = (high, high2) if high > high2 else (high2, high)
    rest = (larger - total) + smaller
    rest += low + low2
    root = sqrt(total + rest)
    high, low = _square(root)
    error = ((total - high) - low) + rest
    return (root + error / (2.0 * root)) / scale


@part
def _square(x: float) -> tuple[float, float]:
    """Return a square and its rounding error."""
    t = x * _SPLIT
    high = t - (t - x)
    low = x - high
    square = x * x
    return square, ((high * high - square) + 2.0 * high * low) + low * low


@part
def gap_to(solid: Any, x: float, y: float) -> float:
    """Return the distance from a point to a solid's surface; 0 or less inside."""
    if solid.round:
        return float(hypot(x - solid.x, y - solid.y) - solid.radius)
    dx, dy, ux, uy = x - solid.x, y - solid.y, solid.ux, solid.uy
    along = abs(dx * ux + dy * uy) - solid.half_length
    across = abs(dy * ux - dx * uy) - solid.half_thickness
    if along <= 0.0 or across <= 0.0:
        return float(max(along, across))
    return hypot(along, across)


@part
def toward(solid: Any, x: float, y: float) -> tuple[float, float, float]:
    """Return the same, and the unit vector from a point at it; inside: deeper into it."""
    dx, dy, ux, uy = solid.x - x, solid.y - y, solid.ux, solid.uy
    if solid.round:
        distance = hypot(dx, dy)
        if distance == 0.0:
            return -solid.radius, 1.0, 0.0
        return distance - solid.radius, dx / distance, dy / distance
    ahead, aside = dx * ux + dy * uy, dy * ux - dx * uy
    along, across = abs(ahead) - solid.half_length, abs(aside) - solid.half_thickness
    if along <= 0.0 or across <= 0.0:
        if along > across:
            gap, along, across = along, (1.0 if ahead > 0.0 else -1.0), 0.0
        else:
            gap, along, across = across, 0.0, (1.0 if aside > 0.0 else -1.0)
    else:
        gap = hypot(along, across)
        along, across = (
            (along if ahead > 0.0 else -along) / gap,
            (across if aside > 0.0 else -across) / gap,
        )
    return gap, along * ux - across * uy, along * uy + across * ux


@part
def ray(solid: Any, x: float, y: float, dx: float, dy: float) -> float:
    """Return metres that a ray from a point goes to reach a solid, infinite if it misses."""
    rx, ry, ux, uy = solid.x - x, solid.y - y, solid.ux, solid.uy
    if solid.round:
        beside = rx * dy - ry * dx
        inside = solid.radius * solid.radius - beside * beside
        if inside < 0.0:
            return inf
        along, half = rx * dx + ry * dy, sqrt(inside)
        if along + half < 0.0:
            return inf
        return along - half if along > half else 0.0
    inverse = 1.0 / (dx * ux + dy * uy + _GLANCE)
    middle, half = (rx * ux + ry * uy) * inverse, solid.half_length * abs(inverse)
    enter, leave = middle - half, middle + half
    inverse = 1.0 / (dy * ux - dx * uy + _GLANCE)
    middle, half = (ry * ux - rx * uy) * inverse, solid.half_thickness * abs(inverse)
    enter, leave = max(enter, middle - half), min(leave, middle + half)
    enter = max(enter, 0.0)
    return enter if leave >= enter else inf


@part
def clearance(solids: Any, x: float, y: float) -> float:
    """Return the distance from a point to the nearest solid; 0 or less inside one."""
    nearest = inf
    for k in range(len(solids)):
        nearest = min(nearest, gap_to(solids[k], x, y))
    return nearest
