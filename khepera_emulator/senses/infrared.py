"""Proximity and ambient light as the eight infrared sensors report them.

Proximity follows the recorded response of each sensor to a white wall (`models`), as a function
of an effective gap: the shortest of five rays within 30 degrees of the sensor's axis, each
lengthened by a penalty that grows with the square of its angle. The penalty (7.2 um per
degree^2) was fitted to the fall-off with heading of S. Nolfi's recorded samples: a wall at 15 mm
reads as one at 20 mm after a turn of 30 degrees, at 31 mm after 48 and at 38 mm after 60.

The record gives readings over the gap between wall and body, taken with the sensor's lobe turned to
the wall. A sensor that looks aside of where it sits is then farther from the wall than the body is,
by up to 1 mm: that much is taken off its gap.
"""

from collections.abc import Sequence
from math import atan2, cos, hypot, inf, pi, sin
from typing import NamedTuple

import numpy as np

from khepera_emulator.arenas.arena import Lamp
from khepera_emulator.body.drawn import Drawn
from khepera_emulator.models import Model, ProximityCurve
from khepera_emulator.senses.reach import Reach
from khepera_emulator.world.floor_plan import Scene
from khepera_emulator.world.rays import Array
from khepera_emulator.world.solids import Solid

NOISE_BLOCK = 64
"""Scans whose noise is drawn at once."""

SCAN_PERIOD = 0.020
"""Seconds for a scan of all eight sensors; N and O return the latest one."""

_RAY_ANGLES = np.radians([-30.0, -15.0, 0.0, 15.0, 30.0])
_PENALTY = 7.2e-6 * np.degrees(_RAY_ANGLES) ** 2
_TABLE_STEP = 0.001
"""Metres; every recorded gap is a multiple, so that the table holds the record itself."""

_ROUNDING = 1e-9
"""Metres by which a gap may exceed the last one of the record and still be it."""

FRONT = 6
"""The first six sensors face where the robot can drive to; the two others look back."""

BLACK_LOSS = 0.5
"""Part of a ray's reach that a black surface takes away (KiKS)."""

_NOISE_SPAN, _NOISE_DEPTH = 13.5, 6.5
"""Readings without any light: evenly spread, and what is less than 0 reads 0. So half of the
readings are 0 and the others 1 to 6 (Nolfi: 48 %, and 1 to 13, mostly small)."""

_HALF = _NOISE_DEPTH / _NOISE_SPAN
_FAR = (inf,) * 8

_NOTHING = -1.0
"""In place of a grey value."""

_LAMP_DISTANCES = (0.0, 0.075, 0.100, 0.200, 0.400, 0.550, 0.750, 0.900, 1.000)
_LAMP_COUNTS = (50.0, 75.0, 100.0, 250.0, 375.0, 400.0, 425.0, 450.0, 500.0)
"""Reading before a 50 W lamp (Khepera II manual 3.1.7, as digitised by RoadNarrows)."""


class Sensor(NamedTuple):
    """Place and direction of a sensor, seen from its robot.

    Attributes:
        foot: metres ahead and to the left of the robot's middle.
        rays: ahead and left parts of each ray's direction, and metres to add to its length, the
            least first: its penalty, less what the sensor is behind the body's edge.
        curve: counts at multiples of `_TABLE_STEP`.
    """

    foot: tuple[float, float]
    rays: tuple[tuple[float, float, float], ...]
    curve: tuple[float, ...]

    def gap_of(self, count: float) -> float:
        """Return the greatest effective gap at which the curve reaches a count; -inf if nowhere."""
        for index in range(len(self.curve) - 1, -1, -1):
            high = self.curve[index]
            if high >= count:
                low = self.curve[index + 1] if index + 1 < len(self.curve) else high
                part = (high - count) / (high - low) if high > low else 0.0
                return (index + part) * _TABLE_STEP
        return -inf


_Wall = tuple[float, float, float, Solid]
"""A solid nearby: its gap to the robot's middle, and how far ahead and left the way to it leads."""


class Infrared:
    """The sensor ring of one robot."""

    def __init__(
        self, model: Model, scene: Scene, lamps: Sequence[Lamp], rng: np.random.Generator
    ) -> None:
        self._model = model
        self._scene = scene
        self._lamps = lamps
        self._ambient_rng, scans = rng.spawn(2)
        self.noise = Drawn(lambda: scan_noises(scans))
        self.sensors = sensor_ring(model)
        self.reach = model.proximity.gaps[-1] + _ROUNDING
        # the body's middle is no further than this from what a sensor can see
        self.sight = model.radius + self.reach - min(each.rays[0][2] for each in self.sensors)
        self.top = model.full_scale
        self.step = model.proximity.step
        self.spread = model.proximity.noise
        # without an object nothing is left of the light, and readings need no steps
        self.residual = tuple(map(float, model.proximity.residual))
        self.silent = not any(model.proximity.residual) and model.proximity.step == 1

    def proximity(self, x: float, y: float, heading: float) -> tuple[int, ...]:
        """Scan at a place (metres) and heading (radians): eight counts."""
        normal, uniform = next(self.noise)
        gaps = self.gaps(x, y, heading)
        if gaps is _FAR and self.silent:
            return tuple([int(_NOISE_SPAN * u - _NOISE_DEPTH) if u > _HALF else 0 for u in uniform])
        fixed, relative = self.spread
        step, top = self.step, self.top
        counts = []
        for sensor, gap in enumerate(gaps):
            value = self.response(sensor, gap) if gap is not inf else self.residual[sensor]
            if value > 0.0:
                value += normal[sensor] * (fixed + relative * value)
            else:
                value = _NOISE_SPAN * uniform[sensor] - _NOISE_DEPTH
            if value > 0.0:
                count = int(value)
                counts.append((count if count < top else top) // step * step)
            else:
                counts.append(0)
        return tuple(counts)

    def response(self, sensor: int, gap: float) -> float:
        """Return the curve of a sensor at an effective gap in metres, without noise.

        Closer than the recorded saturation it goes on rising; beyond the record: the residual.
        """
        if gap > self.reach:
            return self.residual[sensor]
        curve = self.sensors[sensor].curve
        place = max(gap, 0.0) / _TABLE_STEP
        index = min(int(place), len(curve) - 2)
        low = curve[index]
        return low + (place - index) * (curve[index + 1] - low)

    def ambient(self, x: float, y: float, heading: float) -> tuple[int, ...]:
        """Scan ambient light at a place: about 490 counts in the dark, down to 50 before a lamp."""
        values = np.full(8, float(self._model.dark))
        for lamp in self._lamps:
            values += self._lamp_effect(lamp, x, y, heading)
        values = np.maximum(values, 50.0) + self._ambient_rng.uniform(-10.0, 10.0, 8)
        return self._quantise(values)

    def gaps(self, x: float, y: float, heading: float) -> tuple[float, ...]:
        """Return the effective gap of each sensor in metres; infinite beyond its reach."""
        around = self._scene.near(x, y, self.sight)
        if not around:
            return _FAR
        c, s = cos(heading), sin(heading)
        walls = []
        for solid in around:
            gap, nx, ny = solid.toward(x, y)
            walls.append((gap, c * nx + s * ny, c * ny - s * nx, solid))
        return tuple([self._gap(sensor, walls, x, y, c, s) for sensor in self.sensors])

    def _gap(
        self, sensor: Sensor, walls: list[_Wall], x: float, y: float, c: float, s: float
    ) -> float:
        """Return the gap of one sensor; `c` and `s` are cosine and sine of the robot's heading."""
        (foot_ahead, foot_left), rays, _ = sensor
        reach = self.reach
        best = reach
        for ahead, left, penalty in rays:
            # what lies further than this is beyond the reach, or a worse gap than one found already
            distance = best - penalty
            shade = _NOTHING
            for gap, to_ahead, to_left, solid in walls:
                # a solid lies wholly behind the line through the point of it nearest to the robot;
                # few rays can come across that line early enough
                room = gap - foot_ahead * to_ahead - foot_left * to_left
                if room < distance * (ahead * to_ahead + left * to_left) or room <= 0.0:
                    way = solid.ray(
                        x + (c * foot_ahead - s * foot_left),
                        y + (s * foot_ahead + c * foot_left),
                        c * ahead - s * left,
                        s * ahead + c * left,
                    )
                    if way < distance:
                        distance, shade = way, solid.grey
            if shade != _NOTHING:
                dim = (BLACK_LOSS - BLACK_LOSS * shade) * max(reach - distance, 0.0)
                best = min(best, distance + dim + penalty)
        return best if best < reach else inf

    def _lamp_effect(self, lamp: Lamp, x: float, y: float, heading: float) -> Array:
        effect = np.zeros(8)
        c, s = cos(heading), sin(heading)
        for i, direction in enumerate(self._model.sensor_directions):
            fx, fy = self.sensors[i].foot
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
        step, top = self.step, self.top
        return tuple(min(max(int(value), 0), top) // step * step for value in values.tolist())


def scan_noises(rng: np.random.Generator) -> Array:
    """Draw a block of noise, of each scan eight normal numbers and eight from 0 to 1.

    Returns:
        Shape (NOISE_BLOCK, 2, 8).
    """
    normal, uniform = rng.standard_normal((NOISE_BLOCK, 8)), rng.random((NOISE_BLOCK, 8))
    return np.stack([normal, uniform], axis=1)


def sensor_ring(model: Model) -> tuple[Sensor, ...]:
    """Return where the eight sensors of a model sit, where they look, and how they respond."""
    sensors = []
    fan = sorted(zip(_PENALTY.tolist(), _RAY_ANGLES.tolist(), strict=True))
    curves = _tabulate(model.proximity).tolist()
    for number, (bearing, direction) in enumerate(
        zip(model.sensor_bearings, model.sensor_directions, strict=True)
    ):
        foot = model.radius * cos(bearing), model.radius * sin(bearing)
        behind = model.radius * (1.0 - cos(direction - bearing))
        rays = [
            (cos(direction + angle), sin(direction + angle), penalty - behind)
            for penalty, angle in fan
        ]
        sensors.append(Sensor(foot, tuple(rays), tuple(curves[number])))
    return tuple(sensors)


def reach_of(model: Model, count: int, shades: Array, margin: float) -> Reach:
    """Return how far the front and side sensors read a count; see `robot.kind.Kind.reach`."""
    rows = [
        (sensor.foot, (ahead, left), sensor.gap_of(count) + margin - penalty)
        for sensor in sensor_ring(model)[:FRONT]
        for ahead, left, penalty in sensor.rays
    ]
    feet, rays, gaps = (np.array(column) for column in zip(*rows, strict=True))
    # to a dark solid a gap looks longer, by a part of what it falls short of the reach
    loss = BLACK_LOSS * (1.0 - shades[:, None])
    return Reach(feet, rays, (gaps - loss * model.proximity.gaps[-1]) / (1.0 - loss))


def _tabulate(curve: ProximityCurve) -> Array:
    """Return the recorded curves at multiples of `_TABLE_STEP` from 0, shape (8, M).

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
