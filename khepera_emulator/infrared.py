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
from khepera_emulator.geometry import Array, FloorPlan
from khepera_emulator.models import Model
from protocol.side_channel import Pose

SCAN_PERIOD = 0.020
"""Seconds for a scan of all eight sensors; N and O return the latest one."""

_RAY_ANGLES = np.radians([-30.0, -15.0, 0.0, 15.0, 30.0])
_PENALTY = 6.3e-6 * np.degrees(_RAY_ANGLES) ** 2
_BLACK_LOSS = 0.5
"""Part of a ray's reach that a black surface takes away (KiKS)."""

_LAMP_DISTANCES = (0.0, 0.075, 0.100, 0.200, 0.400, 0.550, 0.750, 0.900, 1.000)
_LAMP_COUNTS = (50.0, 75.0, 100.0, 250.0, 375.0, 400.0, 425.0, 450.0, 500.0)
"""Reading before a 50 W lamp (Khepera II manual 3.1.7, as digitised by RoadNarrows)."""


class Infrared:
    """The sensor ring of one robot."""

    def __init__(
        self, model: Model, plan: FloorPlan, lamps: Sequence[Lamp], rng: np.random.Generator
    ) -> None:
        self._model = model
        self._plan = plan
        self._lamps = lamps
        self._rng = rng
        bearings = np.array(model.sensor_bearings)
        self._feet = model.radius * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        directions = np.array(model.sensor_directions)[:, None] + _RAY_ANGLES
        self._rays = np.stack([np.cos(directions), np.sin(directions)], axis=2).reshape(-1, 2)
        self._origins = np.repeat(self._feet, len(_RAY_ANGLES), axis=0)
        self._curves = [_unclipped(model.proximity.gaps, row) for row in model.proximity.counts]

    def proximity(self, pose: Pose) -> tuple[int, ...]:
        """What a scan at a pose reads, with fresh noise; eight counts."""
        curve = self._model.proximity
        values = np.array(
            [
                np.interp(gap, gaps, counts, right=float(residual))
                for gap, (gaps, counts), residual in zip(
                    self.gaps(pose), self._curves, curve.residual, strict=True
                )
            ]
        )
        fixed, relative = curve.noise
        lit = values > 0.0
        noise = self._rng.standard_normal(8) * (fixed + relative * values)
        # without an object about half of the readings are 0 and the others 1 to 13 (Nolfi)
        floor = np.maximum(self._rng.uniform(-6.5, 7.0, 8), 0.0)
        return self._quantise(np.where(lit, values + noise, floor))

    def ambient(self, pose: Pose) -> tuple[int, ...]:
        """Ambient light at a pose: about 490 in the dark, down to 50 before a lamp."""
        values = np.full(8, float(self._model.dark))
        for lamp in self._lamps:
            values += self._lamp_effect(lamp, pose)
        values = np.maximum(values, 50.0) + self._rng.uniform(-10.0, 10.0, 8)
        return self._quantise(values)

    def gaps(self, pose: Pose) -> Array:
        """Effective gap of each sensor to what it sees, in metres; infinite for nothing."""
        c, s = cos(pose.heading), sin(pose.heading)
        turn = np.array([[c, s], [-s, c]])
        origins = self._origins @ turn + (pose.x, pose.y)
        distances, grey = self._plan.cast(origins, self._rays @ turn)
        reach = self._model.proximity.gaps[-1]
        dim = _BLACK_LOSS * (1.0 - grey) * np.maximum(reach - distances, 0.0)
        effective = distances + dim + np.tile(_PENALTY, 8)
        nearest: Array = effective.reshape(8, -1).min(axis=1)
        return nearest

    def _lamp_effect(self, lamp: Lamp, pose: Pose) -> Array:
        effect = np.zeros(8)
        for i, direction in enumerate(self._model.sensor_directions):
            c, s = cos(pose.heading), sin(pose.heading)
            fx, fy = self._feet[i]
            dx = lamp.centre[0] - pose.x - (c * fx - s * fy)
            dy = lamp.centre[1] - pose.y - (s * fx + c * fy)
            distance = max(hypot(dx, dy), 1e-6)
            off_axis = abs((atan2(dy, dx) - pose.heading - direction + pi) % (2 * pi) - pi)
            if off_axis >= pi / 2:
                continue
            origin = np.array([[pose.x + c * fx - s * fy, pose.y + s * fx + c * fy]])
            blocked, _ = self._plan.cast(origin, np.array([[dx, dy]]) / distance)
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
        steps = np.clip(values, 0, top).astype(int) // step * step
        return tuple(steps.tolist())


def _unclipped(gaps: Sequence[float], counts: Sequence[int]) -> tuple[Array, Array]:
    """A recorded curve without its saturated part, which goes on as steeply as it began.

    Noise then acts on the light that the sensor receives, and a robot close to a wall reads a
    steady full scale, as real ones do.
    """
    x, y = np.array(gaps), np.array(counts, dtype=float)
    first = max(int(np.flatnonzero(y < y.max())[0]) - 1, 0)
    x, y = x[first:], y[first:]
    slope = (y[1] - y[0]) / (x[1] - x[0])
    return np.concatenate([[x[0] - 0.1], x]), np.concatenate([[y[0] - 0.1 * slope], y])
