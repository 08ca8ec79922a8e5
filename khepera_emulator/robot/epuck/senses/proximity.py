"""Infrared sensors of an e-puck: reflected and ambient light.

Rays and response are those of `senses.infrared`; the numbers differ. A sensor's own light comes
back a little without any object: that is the zero, which K takes off.
"""

from collections.abc import Iterator, Sequence
from math import cos, inf, sin

import numpy as np

from khepera_emulator.arenas.arena import Lamp
from khepera_emulator.robot.epuck.models import EpuckModel
from khepera_emulator.senses.infrared import Infrared
from khepera_emulator.world.floor_plan import Scene

Scan = tuple[float, ...]

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
        infrared, noise, light = rng.spawn(3)
        self._model = model
        self._scene = scene
        self._lamps = lamps
        self._infrared = Infrared(model, scene, (), infrared)
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

    def _clear(self, x: float, y: float, heading: float) -> list[float]:
        """Return what a scan would read without noise."""
        gaps, offsets = self._infrared.gaps(x, y, heading), self._model.offsets
        response = self._infrared.response
        return [
            offset + (0.0 if gap == inf else response(sensor, gap))
            for sensor, (gap, offset) in enumerate(zip(gaps, offsets, strict=True))
        ]

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


def _normals(rng: np.random.Generator, block: int = 64) -> Iterator[list[float]]:
    """For each scan eight standard normal numbers, drawn in blocks because that is fast."""
    while True:
        yield from rng.standard_normal((block, 8)).tolist()
