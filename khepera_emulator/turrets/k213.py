"""The K213 linear vision turret: 64 grey pixels over 36 degrees ahead, 256 levels.

An image is exposed once a reading period; messages read the latest. Its levels follow KiKS: 50
for black to 245 for white, each within 10 counts of the truth; off the axis a pixel gets less
light, cos^4 as with any simple lens. The turret sees what stands in the arena as rays from the
front edge of the body find it, in even light.
"""

from math import radians
from typing import Final

import numpy as np
from khepera_protocol.serial.errors import RequestError
from khepera_protocol.serial.messages import PROTOCOL_ERROR
from khepera_protocol.serial.turrets import PIXELS, READING_PERIODS, TURRETS
from khepera_protocol.serial.units import CONTROL_PERIOD
from numpy.typing import NDArray

from khepera_emulator.turrets.turret import Site, Values, ticks

FIELD: Final = radians(36.0)
BLACK: Final = 50.0
WHITE: Final = 245.0
NOISE: Final = 10.0
"""Counts up to which a level differs from the truth, evenly spread (KiKS)."""

_ANGLES: Final = FIELD / 2 - (np.arange(PIXELS) + 0.5) * FIELD / PIXELS
"""Bearing of each pixel in radians: the first is the leftmost."""

_FALL_OFF: Final = np.cos(_ANGLES) ** 4


class K213:
    """The linear vision turret of one robot.

    Args:
        site: where it is mounted.
        rng: source of its noise.
        first: number of the leftmost pixel, 1 or 0.
    """

    kind = TURRETS["k213"]

    def __init__(self, site: Site, rng: np.random.Generator, first: int = 1) -> None:
        self._site = site
        self._rng = rng
        self._first = first
        self._tick = 0
        self.power_on()

    def power_on(self) -> None:
        """Begin with a reading period of 200 ms and a first image at once."""
        self._set_period(0)
        self._expose()

    def step(self, now: float) -> None:
        """Take the image that has come due."""
        periods = (ticks(now) - self._tick) // self._period
        if periods > 0:
            self._tick += periods * self._period
            self._expose()

    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        """Carry out a message on the latest image."""
        del now  # images are taken in `step`
        match letter:
            case "B":
                return 1, 0
            case "U":
                self._set_period(arguments[0])
                return ()
            case "Q":
                return self._part(arguments[0], 8)
            case "R":
                return self._part(arguments[0], 16)
            case _:
                return self._read(letter, self._image())

    def _read(self, letter: str, image: NDArray[np.int64]) -> Values:
        match letter:
            case "L":  # mean level, as a 16-bit number (a choice)
                return divmod(int(image.mean() * 256), 256)
            case "M":  # the left pixel of a pair is the high nibble (a choice)
                values = image[0::2] // 16 * 16 + image[1::2] // 16
            case "N":
                values = image
            case "O":
                return (int(image.argmax()) + self._first,)
            case "P":
                return (int(image.argmin()) + self._first,)
            case "S":
                values = image[::2]
            case _:
                values = image[::4]
        return tuple(values.tolist())

    def _part(self, start: int, count: int) -> Values:
        first = start - self._first
        if not 0 <= first <= PIXELS - count:
            raise RequestError(PROTOCOL_ERROR, f"there are no {count} pixels from {start} on")
        return tuple(self._image()[first : first + count].tolist())

    def _set_period(self, code: int) -> None:
        self._period = round(READING_PERIODS[code] / CONTROL_PERIOD)

    def _expose(self) -> None:
        # computed when first asked for: most images are never read
        self._exposed_at = self._site.place()
        self._latest: NDArray[np.int64] | None = None

    def _image(self) -> NDArray[np.int64]:
        if self._latest is None:
            self._latest = self._develop()
        return self._latest

    def _develop(self) -> NDArray[np.int64]:
        x, y, heading = self._exposed_at
        eye = np.array([x, y]) + self._site.radius * np.array([np.cos(heading), np.sin(heading)])
        bearings = heading + _ANGLES
        rays = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        distances, grey = self._site.rays.cast(np.tile(eye, (PIXELS, 1)), rays)
        grey = np.where(np.isfinite(distances), grey, self._site.sky)
        levels = (BLACK + (WHITE - BLACK) * grey) * _FALL_OFF
        noise = self._rng.uniform(-NOISE, NOISE, PIXELS)
        return np.asarray(np.clip(np.rint(levels + noise), 0, 255), dtype=np.int64)
