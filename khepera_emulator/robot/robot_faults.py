"""The bundled faults of a robot, one class each; see `line.fault` for what they are asked for with.

How much a dirty sensor, a weak motor or an empty battery changes are choices: no source measures
them.
"""

from collections.abc import Callable
from typing import Final

import cv2
import numpy as np

from khepera_emulator.line.fault import Effect, Fault, Victim
from khepera_emulator.senses.renderers.view import Image

Counts = tuple[int, ...]
Pair = tuple[float, float]
Change = Callable[[int, int], int]
"""From a count and the number of its sensor to what becomes of it."""

_OFTEN: Final = ("p", "n", "at", "for")


class RobotFault:
    """A fault that changes nothing; kinds change what is theirs."""

    victim = Victim.ROBOT
    keys: tuple[str, ...] = _OFTEN
    once = False
    lasts: float | None = None

    def proximity(self, counts: Counts, fault: Fault) -> Counts:
        """Return what a scan of proximity becomes: eight counts."""
        del fault
        return counts

    def ambient(self, counts: Counts, dark: int, fault: Fault) -> Counts:
        """Return what a scan of ambient light becomes: eight counts; `dark` is one without any."""
        del dark, fault
        return counts

    def speeds(self, speeds: Pair, fault: Fault) -> Pair:
        """Return the speeds that the motors would come to, left and right."""
        del fault
        return speeds

    def grip(self, fault: Fault) -> Pair:
        """Return the way over ground of the left and the right wheel, over what it was."""
        del fault
        return 1.0, 1.0

    def battery(self, share: float) -> float:
        """Return what is left of the battery's voltage after a share of the fault's time."""
        del share
        return 1.0

    def heading(self, fault: Fault) -> float:
        """Return degrees by which the camera looks further to the left."""
        del fault
        return 0.0

    def picture(self, image: Image, fault: Fault) -> Image:
        """Return what a picture of the camera becomes."""
        del fault
        return image


class DeadSensor(RobotFault):
    """An infrared sensor that sees nothing: no light, neither its own nor a lamp's."""

    keys = (*_OFTEN, "sensor")

    def proximity(self, counts: Counts, fault: Fault) -> Counts:
        """Read 0."""
        return _changed(counts, fault, lambda _, __: 0)

    def ambient(self, counts: Counts, dark: int, fault: Fault) -> Counts:
        """Read as in the dark."""
        return _changed(counts, fault, lambda _, __: dark)


class StuckSensor(RobotFault):
    """An infrared sensor that goes on reading what it reads first."""

    keys = (*_OFTEN, "sensor")

    def __init__(self) -> None:
        self._near: Counts | None = None
        self._light: Counts | None = None

    def proximity(self, counts: Counts, fault: Fault) -> Counts:
        """Read what was read first."""
        self._near = held = self._near or counts
        return _changed(counts, fault, lambda _, sensor: held[sensor])

    def ambient(self, counts: Counts, dark: int, fault: Fault) -> Counts:
        """Read what was read first."""
        del dark
        self._light = held = self._light or counts
        return _changed(counts, fault, lambda _, sensor: held[sensor])


class DirtySensor(RobotFault):
    """An infrared sensor that a part of the light reaches."""

    keys = (*_OFTEN, "sensor", "part")
    PART: Final = 0.5

    def proximity(self, counts: Counts, fault: Fault) -> Counts:
        """Read a part."""
        part = fault.part_or(self.PART)
        return _changed(counts, fault, lambda count, _: round(part * count))

    def ambient(self, counts: Counts, dark: int, fault: Fault) -> Counts:
        """Read a part of what light takes away from the reading in the dark."""
        part = fault.part_or(self.PART)
        return _changed(counts, fault, lambda count, _: round(dark - part * (dark - count)))


class WeakMotor(RobotFault):
    """A motor that comes to a part of its speed, whatever drives it."""

    keys = (*_OFTEN, "wheel", "part")
    PART: Final = 0.5

    def speeds(self, speeds: Pair, fault: Fault) -> Pair:
        """Come to a part."""
        return _slowed(speeds, fault, fault.part_or(self.PART))


class JammedMotor(RobotFault):
    """A motor that does not turn: its encoder stands, too."""

    keys = (*_OFTEN, "wheel")

    def speeds(self, speeds: Pair, fault: Fault) -> Pair:
        """Come to a stand."""
        return _slowed(speeds, fault, 0.0)


class WornWheel(RobotFault):
    """A wheel that has grown smaller: it goes a part of the way that its encoder counts."""

    keys = (*_OFTEN, "wheel", "part")
    PART: Final = 0.95

    def grip(self, fault: Fault) -> Pair:
        """Go a part of the way."""
        return _slowed((1.0, 1.0), fault, fault.part_or(self.PART))


class EmptyBattery(RobotFault):
    """A battery that runs empty: its voltage falls for a while, and then the robot starts again.

    Afterwards it is as it was: somebody has charged it.
    """

    keys = ("at", "for")
    effect = Effect.RESET
    lasts = 60.0
    LEFT: Final = 0.6

    def battery(self, share: float) -> float:
        """Fall evenly."""
        return 1.0 - (1.0 - self.LEFT) * share


class FrozenCamera(RobotFault):
    """A camera that goes on giving the picture that it gives first."""

    def __init__(self) -> None:
        self._held: dict[tuple[int, ...], Image] = {}

    def picture(self, image: Image, fault: Fault) -> Image:
        """Give the first one, of the mirror or of the panorama."""
        del fault
        return self._held.setdefault(image.shape, image)


class DarkCamera(RobotFault):
    """A camera that a part of the light reaches."""

    keys = (*_OFTEN, "part")
    PART: Final = 0.3

    def picture(self, image: Image, fault: Fault) -> Image:
        """Darken it."""
        dark = cv2.convertScaleAbs(image, alpha=fault.part_or(self.PART))
        return np.asarray(dark, dtype=np.uint8)


class TurnedCamera(RobotFault):
    """A camera that has turned on its mast."""

    keys = (*_OFTEN, "angle")

    def heading(self, fault: Fault) -> float:
        """Look aside."""
        return fault.angle


def _changed(counts: Counts, fault: Fault, change: Change) -> Counts:
    struck = range(len(counts)) if fault.sensor is None else (fault.sensor,)
    return tuple([change(n, k) if k in struck else n for k, n in enumerate(counts)])


def _slowed(speeds: Pair, fault: Fault, part: float) -> Pair:
    left, right = speeds
    return (
        left if fault.wheel == "right" else part * left,
        right if fault.wheel == "left" else part * right,
    )
