"""Proximity and ambient light as the eight infrared sensors report them.

Proximity follows the recorded response of each sensor to a white wall (`models`), as a function
of an effective gap: the shortest of five rays within 30 degrees of the sensor's axis, each
lengthened by a penalty that grows with the square of its angle. The penalty (6.3 um per
degree^2) was fitted to the fall-off with heading of S. Nolfi's recorded samples: a wall at 15 mm
reads as one at 20 mm after a turn of 30 degrees, at 31 mm after 48 and at 38 mm after 60.
"""

from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin

import numpy as np

from khepera_emulator.arena import Lamp
from khepera_emulator.geometry import Array, Scene
from khepera_emulator.models import Model, ProximityCurve

SCAN_PERIOD = 0.020
"""Seconds for a scan of all eight sensors; N and O return the latest one."""

_RAY_ANGLES = np.radians([-30.0, -15.0, 0.0, 15.0, 30.0])
_PENALTY = 6.3e-6 * np.degrees(_RAY_ANGLES) ** 2
_TABLE_STEP = 0.001
"""Metres; every recorded gap is a multiple, so that the table holds the record itself."""

_BLACK_LOSS = 0.5
"""Part of a ray's reach that a black surface takes away (KiKS)."""

_LAMP_DISTANCES = (0.0, 0.075, 0.100, 0.200, 0.400, 0.550, 0.750, 0.900, 1.000)
_LAMP_COUNTS = (50.0, 75.0, 100.0, 250.0, 375.0, 400.0, 425.0, 450.0, 500.0)
"""Reading before a 50 W lamp (Khepera II manual 3.1.7, as digitised by RoadNarrows)."""


class Infrared:
    """The sensor ring of one robot."""

    def __init__(
        self, model: Model, scene: Scene, lamps: Sequence[Lamp], rng: np.random.Generator
    ) -> None:
        self._model = model
        self._scene = scene
        self._lamps = lamps
        self._rng = rng
        bearings = np.array(model.sensor_bearings)
        self._feet = model.radius * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        directions = np.array(model.sensor_directions)[:, None] + _RAY_ANGLES
        rays = np.stack([np.cos(directions), np.sin(directions)], axis=2).reshape(-1, 2)
        origins = np.repeat(self._feet, len(_RAY_ANGLES), axis=0)
        self._fan = np.concatenate([origins, rays])
        self._penalty = np.tile(_PENALTY, 8)
        self._reach = model.proximity.gaps[-1]
        curves = _tabulate(model.proximity)
        self._curve, self._rows = curves.ravel(), np.arange(8) * curves.shape[1]
        self._last = curves.shape[1] - 2
        self._residual = np.array(model.proximity.residual, dtype=float)

    def proximity(self, x: float, y: float, heading: float) -> tuple[int, ...]:
        """What a scan at a place (metres) and heading (radians) reads: eight counts."""
        values = self.response(self.gaps(x, y, heading))
        fixed, relative = self._model.proximity.noise
        lit = values > 0.0
        noise = self._rng.standard_normal(8) * (fixed + relative * values)
        # without an object about half of the readings are 0 and the others 1 to 13 (Nolfi)
        floor = np.maximum(self._rng.uniform(-6.5, 7.0, 8), 0.0)
        return self._quantise(np.where(lit, values + noise, floor))

    def response(self, gaps: Array) -> Array:
        """The curve of each sensor at its effective gap in metres, without noise.

        Closer than the recorded saturation it goes on rising; beyond the record: the residual.
        """
        place = np.minimum(gaps, self._reach) / _TABLE_STEP
        index = np.minimum(place.astype(int), self._last)
        at = self._rows + index
        low = self._curve[at]
        inside = low + (place - index) * (self._curve[at + 1] - low)
        return np.where(gaps > self._reach, self._residual, inside)

    def ambient(self, x: float, y: float, heading: float) -> tuple[int, ...]:
        """Ambient light at a place: about 490 counts in the dark, down to 50 before a lamp."""
        values = np.full(8, float(self._model.dark))
        for lamp in self._lamps:
            values += self._lamp_effect(lamp, x, y, heading)
        values = np.maximum(values, 50.0) + self._rng.uniform(-10.0, 10.0, 8)
        return self._quantise(values)

    def gaps(self, x: float, y: float, heading: float) -> Array:
        """Effective gap of each sensor to what it sees, in metres; infinite beyond its reach."""
        if self._scene.clearance(x, y) - self._model.radius > self._reach:
            return np.full(8, np.inf)
        c, s = cos(heading), sin(heading)
        fan = self._fan @ np.array([[c, s], [-s, c]])
        half = len(fan) // 2
        distances, grey = self._scene.cast(np.add(fan[:half], (x, y)), fan[half:])
        dim = (_BLACK_LOSS - _BLACK_LOSS * grey) * np.maximum(self._reach - distances, 0.0)
        effective = distances + dim + self._penalty
        nearest: Array = np.minimum.reduce(effective.reshape(8, -1), axis=1)
        return nearest

    def _lamp_effect(self, lamp: Lamp, x: float, y: float, heading: float) -> Array:
        effect = np.zeros(8)
        c, s = cos(heading), sin(heading)
        for i, direction in enumerate(self._model.sensor_directions):
            fx, fy = self._feet[i]
            eye = np.array([x + c * fx - s * fy, y + s * fx + c * fy])
            dx, dy = lamp.centre[0] - eye[0], lamp.centre[1] - eye[1]
            distance = max(hypot(dx, dy), 1e-6)
            off_axis = abs((atan2(dy, dx) - heading - direction + pi) % (2 * pi) - pi)
            if off_axis >= pi / 2:
                continue
            blocked, _ = self._scene.cast(eye[None], np.array([[dx, dy]]) / distance)
            if blocked[0] < distance:
                continue
            # inverse square: a lamp of four times the power acts from twice as far
            counts = np.interp(distance / lamp.power**0.5, _LAMP_DISTANCES, _LAMP_COUNTS)
            effect[i] = -(self._model.dark - min(counts, self._model.dark)) * (
                1.0 - (1.0 - cos(off_axis)) ** 5
            )
        return effect

    def _quantise(self, values: Array) -> tuple[int, ...]:
        step, top = self._model.proximity.step, self._model.full_scale
        return tuple(min(max(int(value), 0), top) // step * step for value in values.tolist())


def _tabulate(curve: ProximityCurve) -> Array:
    """The recorded curves at multiples of `_TABLE_STEP` from 0, shape (8, M).

    The saturated part is replaced: a curve goes on as steeply as it began. Noise then acts on
    the light that the sensor receives, and a robot close to a wall reads a steady full scale, as
    real ones do.
    """
    recorded = np.array(curve.gaps)
    gaps = np.arange(round(curve.gaps[-1] / _TABLE_STEP) + 1) * _TABLE_STEP
    rows = []
    for counts in np.array(curve.counts, dtype=float):
        first = max(int(np.flatnonzero(counts < counts.max())[0]) - 1, 0)
        x, y = recorded[first:], counts[first:]
        slope = (y[1] - y[0]) / (x[1] - x[0])
        rows.append(np.where(gaps < x[0], y[0] + (gaps - x[0]) * slope, np.interp(gaps, x, y)))
    return np.array(rows)
