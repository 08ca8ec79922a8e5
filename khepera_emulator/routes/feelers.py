"""A robot as wide as its sensors find a collision, in many places at once.

The controller counts it as a collision when a front or side infrared sensor is saturated. Each ray
of a sensor is therefore a feeler of a fixed length, which is shorter for darker solids (the robot's
kind tells it, `robot.kind.Kind.reach`), and the robot has collided where a feeler or its body
touches something. A margin makes feelers longer and the body wider. Where a ray meets two colours
at a corner, both count: the sensor sees the first one only.
"""

from math import hypot
from typing import Final, NamedTuple

import numpy as np
from khepera_protocol.zenoh.payloads import Outline
from numpy.typing import NDArray

from khepera_emulator.models import Model
from khepera_emulator.robot.kind import kind_of
from khepera_emulator.world.rays import NEVER, Array

Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]

_BEARINGS: Final = 360
"""Directions for which it is known how far a feeler comes."""

_ROUND: Final = 8
"""Corners from which on an outline may be that of a disc."""

_SAME: Final = 1e-6
"""Metres that corners may be beside a rectangle or a circle."""


class Poses(NamedTuple):
    """Places and headings of a robot, in metres and radians; arrays of the same shape."""

    x: Array
    y: Array
    heading: Array

    def take(self, numbers: Indices) -> "Poses":
        """Return some of them."""
        return Poses(self.x[numbers], self.y[numbers], self.heading[numbers])


class Solids(NamedTuple):
    """Rectangles and discs: a disc is a rectangle of no size with a radius.

    Attributes:
        x, y: centres, in metres.
        ux, uy: unit vectors along their lengths.
        half_length, half_thickness, radius: metres.
        grey: brightness to infrared, 0 to 1.
    """

    x: Array
    y: Array
    ux: Array
    uy: Array
    half_length: Array
    half_thickness: Array
    radius: Array
    grey: Array

    def take(self, numbers: Indices) -> "Solids":
        """Return some of them."""
        return Solids(*(column[numbers] for column in self))


_Shape = tuple[float, float, float, float, float, float, float]
"""All that `Solids` has of one solid but for its grey."""


def solids_of(outline: Outline) -> Solids:
    """Return the solids of an arena's outline; what is neither rectangle nor disc as its edges."""
    rows = [(*shape, sum(s.colour) / 3) for s in outline.solids for shape in _shapes(s.corners)]
    return Solids(*np.array(rows, dtype=float).reshape(-1, len(Solids._fields)).T)


def _shapes(corners: list[tuple[float, float]]) -> list[_Shape]:
    count = len(corners)
    x, y = sum(x for x, _ in corners) / count, sum(y for _, y in corners) / count
    radii = [hypot(cx - x, cy - y) for cx, cy in corners]
    even = max(radii) - min(radii) <= _SAME
    if even and count >= _ROUND:
        return [(x, y, 1.0, 0.0, 0.0, 0.0, max(radii))]
    edges = [
        _edge(a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True) if a != b
    ]
    # four corners equally far from their middle, and opposite edges of the same length
    if even and len(edges) == count == 4:
        (_, _, ux, uy, length, *_), (_, _, _, _, width, *_), opposite, other = edges
        if abs(length - opposite[4]) + abs(width - other[4]) <= _SAME:
            return [(x, y, ux, uy, length, width, 0.0)]
    return edges


def _edge(a: tuple[float, float], b: tuple[float, float]) -> _Shape:
    length = hypot(b[0] - a[0], b[1] - a[1])
    ux, uy = (b[0] - a[0]) / length, (b[1] - a[1]) / length
    return (a[0] + b[0]) / 2, (a[1] + b[1]) / 2, ux, uy, length / 2, 0.0, 0.0


class Feelers:
    """The body and the feelers of one robot among solids.

    Args:
        solids: all that it can touch.
        model: which robot.
        collision: reading of a front or side sensor, on the line, that counts as a collision.
        margin: metres that feelers are longer and the body is wider than that.

    Raises:
        EmulatorError: the kind of the model is not there.
    """

    def __init__(self, solids: Solids, model: Model, collision: int, margin: float) -> None:
        self._solids = solids
        self._turns = np.arctan2(solids.uy, solids.ux)
        self._body = model.radius + margin
        shades, self._shades = np.unique(solids.grey, return_inverse=True)
        feet, rays, self._lengths = kind_of(model).reach(model, collision, shades, margin)
        self._foot_ahead, self._foot_left = feet.T
        self._ahead, self._left = rays.T
        self._needs, self._farthest = self._reaches()
        self._most = float(self._needs.max(initial=self._body))
        self._all = np.arange(len(rays))[None]

    def touch(self, poses: Poses, steps: Array) -> Flags:
        """Tell where a robot has collided.

        Args:
            poses: N of them.
            steps: K poses as seen from each of those, in metres ahead and to the left and in
                radians turned; shape (K, 3).

        Returns:
            Shape (N, K).
        """
        touched = np.zeros((len(poses.x), len(steps)), dtype=bool)
        # pairs of a pose and a solid that is in reach of its steps
        reach = self._most + np.hypot(steps[:, 0], steps[:, 1]).max()
        owner, number = np.nonzero(_gap(self._solids, poses.x[:, None], poses.y[:, None]) <= reach)
        there = _stepped(poses.take(owner), steps)
        gap = _gap(self._solids.take(number[:, None]), there.x, there.y)
        hit = gap <= self._body
        pair, step = np.nonzero((gap <= self._most) & ~hit)
        hit[pair, step] = self._feel(
            Poses(*(part[pair, step] for part in there)), number[pair], gap[pair, step]
        )
        pair, step = np.nonzero(hit)
        touched[owner[pair], step] = True
        return touched

    def _reaches(self) -> tuple[Array, Indices]:
        """Return how far feelers come in each direction, and which one comes farthest.

        A convex solid lies behind the line through its point nearest to the robot: from beyond
        that distance no feeler reaches it. By shade and bearing.
        """
        lengths = np.maximum(self._lengths, 0.0)[:, None]
        ahead = self._foot_ahead + lengths * self._ahead
        left = self._foot_left + lengths * self._left
        bearings = np.arange(_BEARINGS)[:, None] * (2 * np.pi / _BEARINGS)
        tips = np.cos(bearings) * ahead + np.sin(bearings) * left
        # between two bearings a tip comes no more than this farther
        rest = np.hypot(ahead, left).max(initial=0.0) * np.pi / _BEARINGS
        return np.maximum(tips.max(axis=2) + rest, self._body), tips.argmax(axis=2)

    def _feel(self, poses: Poses, solids: Indices, gaps: Array) -> Flags:
        """Tell whether the robot feels the solid that goes with each pose, at a gap."""
        felt = np.zeros(len(gaps), dtype=bool)
        bearing, shade = self._bearing(poses, solids), self._shades[solids]
        doubt = np.flatnonzero(gaps <= self._needs[shade, bearing])
        # in doubt it is mostly the feeler that comes farthest; near corners it may be any
        first = self._farthest[shade[doubt], bearing[doubt], None]
        felt[doubt] = self._reach(poses.take(doubt), solids[doubt], first)
        doubt = doubt[~felt[doubt]]
        felt[doubt] = self._reach(poses.take(doubt), solids[doubt], self._all)
        return felt

    def _bearing(self, poses: Poses, solids: Indices) -> Indices:
        """Return the direction in which the nearest point of a solid lies, in whole bearings."""
        s = self._solids.take(solids)
        ahead, aside = _beside(s, poses.x, poses.y)
        along = np.copysign(np.maximum(np.abs(ahead) - s.half_length, 0.0), ahead)
        across = np.copysign(np.maximum(np.abs(aside) - s.half_thickness, 0.0), aside)
        angle = np.arctan2(across, along) + self._turns[solids] - poses.heading
        bearing: Indices = np.rint(angle * (_BEARINGS / (2 * np.pi))).astype(np.intp) % _BEARINGS
        return bearing

    def _reach(self, poses: Poses, solids: Indices, feelers: Indices) -> Flags:
        """Tell whether one of some feelers reaches the solid that goes with each pose."""
        s = self._solids.take(solids[:, None])
        # everything as seen from the solid
        ahead, aside = _beside(s, poses.x[:, None], poses.y[:, None])
        turn = (poses.heading - self._turns[solids])[:, None]
        cosine, sine = np.cos(turn), np.sin(turn)
        foot_ahead, foot_left = self._foot_ahead[feelers], self._foot_left[feelers]
        ray_ahead, ray_left = self._ahead[feelers], self._left[feelers]
        foot = (
            cosine * foot_ahead - sine * foot_left - ahead,
            sine * foot_ahead + cosine * foot_left - aside,
        )
        ray = cosine * ray_ahead - sine * ray_left, sine * ray_ahead + cosine * ray_left
        enter, leave = _through_rectangle(foot, ray, s)
        round_ones = np.flatnonzero(s.radius[:, 0])
        if len(round_ones):
            enter[round_ones], leave[round_ones] = _through_disc(
                (foot[0][round_ones], foot[1][round_ones]),
                (ray[0][round_ones], ray[1][round_ones]),
                s.radius[round_ones],
            )
        enter = np.maximum(enter, 0.0)
        lengths = self._lengths[self._shades[solids][:, None], feelers]
        return np.asarray(((enter <= leave) & (enter <= lengths)).any(axis=1))


def _stepped(poses: Poses, steps: Array) -> Poses:
    """Return N poses after each of K steps: shape (N, K)."""
    ahead, left, turn = steps.T
    x, y, heading = (part[:, None] for part in poses)
    cosine, sine = np.cos(heading), np.sin(heading)
    return Poses(x + cosine * ahead - sine * left, y + sine * ahead + cosine * left, heading + turn)


def _beside(solids: Solids, x: Array, y: Array) -> tuple[Array, Array]:
    """Return where the middles of solids are from points: along their lengths, and across."""
    dx, dy = solids.x - x, solids.y - y
    return dx * solids.ux + dy * solids.uy, dy * solids.ux - dx * solids.uy


def _gap(solids: Solids, x: Array, y: Array) -> Array:
    """Return the distances from points to solids, 0 or less inside."""
    ahead, aside = _beside(solids, x, y)
    along = np.maximum(np.abs(ahead) - solids.half_length, 0.0)
    across = np.maximum(np.abs(aside) - solids.half_thickness, 0.0)
    gap: Array = np.hypot(along, across) - solids.radius
    return gap


def _through_rectangle(
    foot: tuple[Array, Array], ray: tuple[Array, Array], solids: Solids
) -> tuple[Array, Array]:
    """Return the ways at which rays enter and leave rectangles; the second is less if never."""
    # a ray along a face never crosses it
    along, across = (1.0 / (part + 1.0 / NEVER) for part in ray)
    middle, half = -foot[0] * along, solids.half_length * np.abs(along)
    other, other_half = -foot[1] * across, solids.half_thickness * np.abs(across)
    return np.maximum(middle - half, other - other_half), np.minimum(
        middle + half, other + other_half
    )


def _through_disc(
    foot: tuple[Array, Array], ray: tuple[Array, Array], radius: Array
) -> tuple[Array, Array]:
    """Return the ways at which rays enter and leave discs; the second is less if never."""
    along = -(foot[0] * ray[0] + foot[1] * ray[1])
    beside = foot[0] * ray[1] - foot[1] * ray[0]
    inside = radius**2 - beside**2
    half = np.sqrt(np.maximum(inside, 0.0))
    return along - half, np.where(inside >= 0.0, along + half, -NEVER)
