"""Infrared sensors of an e-puck: reflected and ambient light.

A sensor sees the nearest of five rays within 30 degrees of its axis, each lengthened by a penalty
that grows with its angle, as a Khepera's (`senses.infrared`); what comes back is the response to
a white wall at that distance, times what its colour reflects. A sensor's own light comes back a
little without any object, too: that is the zero, which K takes off.
"""

from collections.abc import Iterator, Sequence
from math import cos, sin

import numpy as np

from khepera_emulator.arenas.arena import Lamp
from khepera_emulator.robot.epuck.models import EpuckModel
from khepera_emulator.senses.reach import Reach
from khepera_emulator.world.floor_plan import Scene
from khepera_emulator.world.rays import Array

Scan = tuple[float, ...]

_FAN = np.radians([-30.0, -15.0, 0.0, 15.0, 30.0])
_PENALTY = 7.2e-6 * np.degrees(_FAN) ** 2
"""Metres by which a ray aside of the axis is lengthened (Nolfi's recordings of a Khepera)."""

_BLACK = 0.25
"""Part of a white wall's response that a black one gives: seen from half as far (a choice)."""

_FRONT = (0, 1, 2, 5, 6, 7)
"""Numbers of the sensors that face where the robot can drive to; the two others look back."""

_SAMPLES = 100
"""Scans that a zero is the mean of."""

_AMBIENT_NOISE = 8.0
_BRIGHT = 50.0
"""Least reading of ambient light, before a lamp."""

_NEAR_LAMP = 0.30
"""Metres from a lamp of 50 W at which a sensor that looks into it reads half (a choice)."""


class Ring:
    """The eight sensors of a robot.

    Args:
        model: which robot, with the places that hold.
        scene: what there is to see.
        lamps: of the arena.
        rng: source of the noise.
    """

    def __init__(
        self, model: EpuckModel, scene: Scene, lamps: Sequence[Lamp], rng: np.random.Generator
    ) -> None:
        noise, light = rng.spawn(2)
        self._model = model
        self._scene = scene
        self._lamps = lamps
        self._gaps = np.array(model.proximity.gaps)
        self._counts = np.array(model.proximity.counts[0], dtype=float)
        self._sight = model.radius + self._gaps[-1]
        self._feet, self._rays = _fans(model)
        self._noise = _normals(noise)
        self._light = _normals(light)

    def reflected(self, x: float, y: float, heading: float) -> Scan:
        """Scan at a place: what the sensors get of their own light, zero and noise included."""
        fixed, relative = self._model.proximity.noise
        clear = self._clear(x, y, heading)
        return tuple(
            [
                value + (fixed + relative * value) * noise
                for value, noise in zip(clear, next(self._noise), strict=True)
            ]
        )

    def zeros(self, x: float, y: float, heading: float) -> Scan:
        """Take the mean of many scans at a place."""
        fixed, relative = self._model.proximity.noise
        clear = self._clear(x, y, heading)
        spread = 1.0 / _SAMPLES**0.5
        return tuple(
            [
                float(int(value + spread * (fixed + relative * value) * noise))
                for value, noise in zip(clear, next(self._noise), strict=True)
            ]
        )

    def counts(self, scan: Scan, zeros: Scan) -> tuple[int, ...]:
        """Return readings: what a scan is above the zeros, within the converter's range."""
        top = self._model.full_scale
        pairs = zip(scan, zeros, strict=True)
        return tuple([max(int(min(max(value, 0.0), top) - zero), 0) for value, zero in pairs])

    def ambient(self, x: float, y: float, heading: float) -> tuple[int, ...]:
        """Scan ambient light at a place: about 4000 in the dark, little before a lamp."""
        dark, top = float(self._model.dark), self._model.full_scale
        values = []
        for sensor, noise in enumerate(next(self._light)):
            light = sum(self._light_of(lamp, sensor, x, y, heading) for lamp in self._lamps)
            value = dark / (1.0 + light) + _AMBIENT_NOISE * noise
            values.append(int(min(max(value, _BRIGHT), top)))
        return tuple(values)

    def response(self, gap: Array) -> Array:
        """Return the reading of a white wall at gaps in metres, without zero and noise."""
        return np.asarray(np.interp(gap, self._gaps, self._counts))

    def _clear(self, x: float, y: float, heading: float) -> list[float]:
        """Return what a scan would read without noise."""
        offsets = self._model.offsets
        if not self._scene.near(x, y, self._sight):
            return [float(offset) for offset in offsets]
        c, s = cos(heading), sin(heading)
        turn = np.array([[c, s], [-s, c]])
        feet = np.repeat(self._feet @ turn + (x, y), len(_FAN), axis=0)
        ways, greys = self._scene.cast(feet, (self._rays @ turn).reshape(-1, 2))
        ways = ways.reshape(len(offsets), -1) + _PENALTY
        seen = self.response(ways) * (_BLACK + (1.0 - _BLACK) * greys.reshape(ways.shape))
        return [float(value) for value in seen.max(axis=1) + offsets]

    def _light_of(self, lamp: Lamp, sensor: int, x: float, y: float, heading: float) -> float:
        """Return the light of a lamp at a sensor, in what halves its reading."""
        model = self._model
        place = heading + model.sensor_bearings[sensor]
        eye_x, eye_y = x + model.radius * cos(place), y + model.radius * sin(place)
        dx, dy = lamp.centre[0] - eye_x, lamp.centre[1] - eye_y
        distance = max((dx * dx + dy * dy) ** 0.5, 1e-6)
        look = heading + model.sensor_directions[sensor]
        facing = (dx * cos(look) + dy * sin(look)) / distance
        if facing <= 0.0:
            return 0.0
        origin, ray = np.array([[eye_x, eye_y]]), np.array([[dx, dy]]) / distance
        blocked, _ = self._scene.cast(origin, ray)
        if blocked[0] < distance:
            return 0.0
        return float(lamp.power * facing * (_NEAR_LAMP / distance) ** 2)


def reach_of(model: EpuckModel, count: int, shades: Array, margin: float) -> Reach:
    """Return how far the front and side sensors read a count; see `robot.kind.Kind.reach`."""
    feet, rays = (part[list(_FRONT)] for part in _fans(model))
    # what a solid reflects less than a white wall, the response must make up for
    wanted = count / (_BLACK + (1.0 - _BLACK) * shades)
    response = np.array(model.proximity.counts[0])
    gaps = np.interp(wanted, response[::-1], model.proximity.gaps[::-1], right=-np.inf)
    lengths = gaps[:, None] + margin - np.tile(_PENALTY, len(_FRONT))
    return Reach(np.repeat(feet, len(_FAN), axis=0), rays.reshape(-1, 2), lengths)


def _fans(model: EpuckModel) -> tuple[Array, Array]:
    """Return where the sensors sit, shape (8, 2), and their rays' directions, shape (8, 5, 2)."""
    bearings = np.array(model.sensor_bearings)
    feet = model.radius * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    looks = np.array(model.sensor_directions)[:, None] + _FAN
    return feet, np.stack([np.cos(looks), np.sin(looks)], axis=2)


def _normals(rng: np.random.Generator, block: int = 64) -> Iterator[list[float]]:
    """For each scan eight standard normal numbers, drawn in blocks because that is fast."""
    while True:
        yield from rng.standard_normal((block, 8)).tolist()
