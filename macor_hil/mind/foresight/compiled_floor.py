"""Solid pieces of a floor's end and distances to them, compiled; `foresight.floor` is plain."""

from math import sqrt
from typing import Any

import numpy as np
from khepera_protocol.system.compiled import compiled


@compiled
def solids(profile: Any, c: Any, s: Any, jump: float, gap: float) -> Any:
    """Return the beginnings and the ends of straight solid pieces, both of shape (n, 2).

    Args:
        profile: inverse distances, shape (directions,).
        c: cosine of each direction.
        s: sine of it.
        jump: change of inverse distance up to which two directions show one solid.
        gap: distance below which two places leave no way.
    """
    directions = len(profile)
    begin, end = np.empty((directions, 2)), np.empty((directions, 2))
    n = 0
    for k in range(directions):
        after = k + 1 if k + 1 < directions else 0
        x, y = c[k] / profile[k], s[k] / profile[k]
        x_after, y_after = c[after] / profile[after], s[after] / profile[after]
        one = abs(profile[k] - profile[after]) < jump
        if one or np.hypot(x_after - x, y_after - y) < gap:
            begin[n, 0], begin[n, 1] = x, y
            end[n, 0], end[n, 1] = x_after, y_after
            n += 1
    return begin[:n], end[:n]


@compiled
def clearance(begin: Any, end: Any, places: Any, products: Any) -> Any:
    """Return the distance from each place to the nearest of some solid pieces, shape (n,).

    Args:
        begin: of the pieces, shape (m, 2).
        end: of them.
        places: shape (n, 2).
        products: of places and the pieces' directions, shape (n, m).
    """
    pieces = len(begin)
    along, length, offset = np.empty((pieces, 2)), np.empty(pieces), np.empty(pieces)
    for k in range(pieces):
        ax, ay = end[k, 0] - begin[k, 0], end[k, 1] - begin[k, 1]
        along[k, 0], along[k, 1] = ax, ay
        length[k] = max(ax * ax + ay * ay, 1e-9)
        offset[k] = begin[k, 0] * ax + begin[k, 1] * ay
    nearest = np.empty(len(places))
    for place in range(len(places)):
        least = np.inf
        for k in range(pieces):
            share = (products[place, k] - offset[k]) / length[k]
            share = min(max(share, 0.0), 1.0)
            x = places[place, 0] - (begin[k, 0] + share * along[k, 0])
            y = places[place, 1] - (begin[k, 1] + share * along[k, 1])
            least = min(least, x * x + y * y)
        nearest[place] = sqrt(least)
    return nearest
