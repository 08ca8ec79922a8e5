"""The foreground: what stands or hangs before the skyline, drawn from far to near.

In every column of the atlas a ray meets a shape, seen from above, over a stretch. An upright one
shows its side there, between two rows, and its upper or lower face between the ends of the
stretch. Sides and faces are spans; what is nearer is painted later (painter's algorithm).
"""

from collections.abc import Sequence
from math import hypot
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from khepera_emulator.senses.renderers.skyline import ROWS, Skyline, View
from khepera_emulator.senses.renderers.view import AMBIENT, DIFFUSE, FLOOR_SHADE, LIGHT
from khepera_emulator.world.looks import Ball, Block, Drum, Look
from khepera_emulator.world.rays import NEVER, Array

_SUN = np.array(LIGHT) / hypot(*LIGHT)

_BANDS = 4
"""Bands that a ball is painted in."""

_UPPER_EDGES = np.linspace(-1.0, 1.0, _BANDS + 1)[1:, None, None]
"""Sines over the ball's disc of the bands' upper edges, from below; shape (_BANDS, 1, 1)."""

_MIDDLES = _UPPER_EDGES - 1.0 / _BANDS
_DEEP = -np.sqrt(1.0 - _MIDDLES**2)

_TINY = 1e-9
"""Metres by which one of two spans that lie together is nearer."""

_ROW = np.arange(ROWS, dtype=float)[:, None]

_L = TypeVar("_L", Block, Drum, Ball)


class _Crossing(NamedTuple):
    """Shapes, seen from above, as the rays of all columns meet them; shape (S, C).

    Attributes:
        enter, leave: metres to the ends of the stretch; enter is infinite where it is missed.
        lit: cosine between the light and the side's normal, 0 in the shade.
    """

    enter: Array
    leave: Array
    lit: Array


class _Spans(NamedTuple):
    """Stretches of the atlas' columns; shape (S, C).

    Attributes:
        distance: metres; what is nearer hides the rest. Infinite: it is not there.
        top, bottom: its rows, with their fractions.
        colour: blue, green and red, shape (S, C, 3).
    """

    distance: Array
    top: Array
    bottom: Array
    colour: NDArray[np.float32]


def paint(
    looks: Sequence[Look], place: tuple[float, float, float], line: Skyline, view: View
) -> None:
    """Paint shapes onto a skyline.

    Args:
        looks: the shapes.
        place: the viewpoint, in metres.
        line: the skyline.
        view: what it has drawn; the picture is changed.
    """
    x, y, eye = place
    (columns,) = np.nonzero(_may_meet(looks, x, y, view.rays))
    if not len(columns):
        return
    rays = view.rays[:, columns]
    spans: list[_Spans] = []
    if blocks := _of(Block, looks):
        spans += _upright(blocks, _cross_blocks(blocks, x, y, rays), eye, line)
    if drums := _of(Drum, looks):
        spans += _upright(drums, _cross_drums(drums, x, y, rays), eye, line)
    if balls := _of(Ball, looks):
        spans.append(_round(balls, x, y, eye, line, rays))
    _paint(_joined(spans), view, columns)


def _may_meet(looks: Sequence[Look], x: float, y: float, rays: Array) -> NDArray[np.bool_]:
    """Tell in which columns anything can be, by circles around the shapes."""
    circles = [(look.x - x, look.y - y, look.reach) for look in looks]
    dx, dy, reach = np.array(circles).T[:, :, None]
    ahead = dx * rays[0] + dy * rays[1] > -reach
    near = ahead & (np.abs(dx * rays[1] - dy * rays[0]) < reach)
    return np.asarray(near.any(axis=0))


def _of(kind: type[_L], looks: Sequence[Look]) -> list[_L]:
    return [look for look in looks if isinstance(look, kind)]


def _cross_blocks(blocks: Sequence[Block], x: float, y: float, rays: Array) -> _Crossing:
    cx, cy, ux, uy, half_length, half_thickness = np.array([block[:6] for block in blocks]).T[
        :, :, None
    ]
    dx, dy = cx - x, cy - y
    # along its length and across: the ways to the lines of both ends, and of both long faces
    axes = ((ux, uy, half_length), (-uy, ux, half_thickness))
    nears, fars, lits = [], [], []
    for ax, ay, half in axes:
        slope = ax * rays[0] + ay * rays[1] + 1.0 / NEVER
        middle, reach = (dx * ax + dy * ay) / slope, half / np.abs(slope)
        nears.append(middle - reach)
        fars.append(middle + reach)
        lits.append(np.maximum(-np.sign(slope) * (ax * _SUN[0] + ay * _SUN[1]), 0.0))
    enter, leave = np.maximum(*nears), np.minimum(*fars)
    lit = np.where(nears[0] > nears[1], *lits)
    return _Crossing(np.where((leave >= enter) & (enter > 0.0), enter, np.inf), leave, lit)


def _cross_drums(drums: Sequence[Drum], x: float, y: float, rays: Array) -> _Crossing:
    cx, cy, radius = np.array([drum[:3] for drum in drums]).T[:, :, None]
    dx, dy = cx - x, cy - y
    along, beside = dx * rays[0] + dy * rays[1], dx * rays[1] - dy * rays[0]
    half = np.sqrt(np.maximum(radius**2 - beside**2, 0.0))
    enter = along - half
    normal = (enter * rays[0] - dx) / radius, (enter * rays[1] - dy) / radius
    lit = np.maximum(_SUN[0] * normal[0] + _SUN[1] * normal[1], 0.0)
    met = (np.abs(beside) < radius) & (enter > 0.0)
    return _Crossing(np.where(met, enter, np.inf), along + half, lit)


def _upright(
    shapes: Sequence[Block] | Sequence[Drum], met: _Crossing, eye: float, line: Skyline
) -> list[_Spans]:
    """Return the sides of upright shapes, and their upper and lower faces where they are seen."""
    ends = np.array([(shape.bottom, shape.top) for shape in shapes])
    bottom, top = (ends - eye).T[:, :, None]
    upper, lower = line.row(top, met.enter), line.row(bottom, met.enter)
    colours = _bytes(shapes)
    spans = [_Spans(met.enter, upper, lower, _shaded(colours, AMBIENT + DIFFUSE * met.lit))]
    gone = met.enter == np.inf
    for height, edge, shade in ((top, upper, FLOOR_SHADE), (bottom, lower, AMBIENT)):
        seen = (height < 0.0) if shade == FLOOR_SHADE else (height > 0.0)
        if not seen.any():
            continue
        far = line.row(height, met.leave)
        # a row further than its edge: the side covers it, and nothing shines through between
        rows = (far, edge + 1.0) if shade == FLOOR_SHADE else (edge - 1.0, far)
        distance = np.where(gone | ~seen, np.inf, met.leave)
        spans.append(_Spans(distance, *rows, _shaded(colours, np.full(gone.shape, shade))))
    return spans


def _round(
    balls: Sequence[Ball], x: float, y: float, eye: float, line: Skyline, rays: Array
) -> _Spans:
    """Return balls in bands of even light; in a column a ball is a disc."""
    cx, cy, cz, radius = np.array([ball[:4] for ball in balls]).T[:, :, None]
    dx, dy, dz = cx - x, cy - y, cz - eye
    along, beside = dx * rays[0] + dy * rays[1], dx * rays[1] - dy * rays[0]
    disc = np.sqrt(np.maximum(radius**2 - beside**2, 0.0))
    away = np.hypot(along, dz)
    met = (disc > 0.0) & (along > 0.0) & (away > disc)
    middle, share = np.arctan2(dz, along), np.minimum(disc / away, 1.0)
    # a band's normal: against its ray and across it, then level along the ray, to its right, up
    against, across, elevation = _DEEP, _MIDDLES, middle + np.arcsin(_MIDDLES * share)
    cosine, sine, scale = np.cos(elevation), np.sin(elevation), disc / radius
    level, up = (
        (against * cosine - across * sine) * scale,
        (against * sine + across * cosine) * scale,
    )
    right = -beside / radius
    lit = (level * rays[0] + right * rays[1]) * _SUN[0] + up * _SUN[2]
    lit += (level * rays[1] - right * rays[0]) * _SUN[1]
    # each down to the ball's foot: the bands below are painted over it
    distance = np.where(met, along - disc - _TINY * (1.0 - _MIDDLES), np.inf)
    upper = line.row_at(middle + np.arcsin(_UPPER_EDGES * share))
    lower = np.broadcast_to(line.row_at(middle - np.arcsin(share)), upper.shape)
    colours = np.tile(_bytes(balls), (len(_MIDDLES), 1, 1))
    distance, upper, lower, lit = (
        part.reshape(-1, rays.shape[1]) for part in (distance, upper, lower, lit)
    )
    shade = AMBIENT + DIFFUSE * np.maximum(lit, 0.0)
    return _Spans(distance, upper, lower, _shaded(colours, shade))


def _bytes(looks: Sequence[Look]) -> NDArray[np.float32]:
    """Return blue, green and red of shapes as PyBullet makes them, shape (S, 1, 3)."""
    colours = np.array([look.colour for look in looks], dtype=np.float32)
    return np.asarray(np.floor(colours[:, None, ::-1] * 255))


def _shaded(colours: NDArray[np.float32], shade: Array) -> NDArray[np.float32]:
    return np.asarray(np.floor(colours * shade.astype(np.float32)[:, :, None]))


def _joined(spans: Sequence[_Spans]) -> _Spans:
    distances, tops, bottoms, colours = zip(*spans, strict=True)
    distance, top, bottom = (np.concatenate(each) for each in (distances, tops, bottoms))
    return _Spans(distance, top, bottom, np.concatenate(colours))


def _paint(spans: _Spans, view: View, columns: NDArray[np.intp]) -> None:
    """Paint spans of some of the columns."""
    # of what is behind the skyline there is to be seen what is higher
    behind = spans.distance > view.distances[columns]
    bottom = np.where(behind, np.minimum(spans.bottom, view.top[columns]), spans.bottom)
    there = (spans.distance < np.inf) & (bottom > spans.top) & (bottom > 0.0) & (spans.top < ROWS)
    order = np.argsort(np.where(there, -spans.distance, np.inf), axis=0)
    counts = there.sum(axis=0)
    patch = view.picture[:, columns].astype(np.float32)
    for turn in range(counts.max()):
        (now,) = np.nonzero(counts > turn)
        which = order[turn, now]
        upper, lower = spans.top[which, now], bottom[which, now]
        first, last = max(int(upper.min()), 0), min(int(lower.max()) + 1, ROWS)
        rows = _ROW[first:last]
        share = np.minimum(np.minimum(lower - rows, rows + 1.0 - upper), 1.0)
        share = np.minimum(share, lower - upper)
        share = np.maximum(share, 0.0)[:, :, None].astype(np.float32)
        before = patch[first:last, now]
        patch[first:last, now] = before + share * (spans.colour[which, now] - before)
    view.picture[:, columns] = patch
