"""The robot's own faults in time: those that last change sensors, motors, battery and camera."""

from math import radians

from khepera_emulator.line.fault import Spell
from khepera_emulator.line.faults import Faults
from khepera_emulator.robot.robot_faults import Counts, Pair
from khepera_emulator.senses.renderers.view import Image


class Ailments:
    """Faults of one robot.

    Args:
        faults: those of its line, and its own.
        origin: the line's time at the robot's time 0.
    """

    def __init__(self, faults: Faults, origin: float) -> None:
        self._faults = faults
        self._origin = origin

    def names(self, time: float) -> tuple[str, ...]:
        """List the kinds that last at a time of the robot."""
        return tuple(spell.fault.kind for spell in self._lasting(time))

    def proximity(self, time: float, counts: Counts) -> Counts:
        """Return what a scan of proximity becomes."""
        for spell in self._lasting(time):
            counts = spell.kind.proximity(counts, spell.fault)
        return counts

    def ambient(self, time: float, counts: Counts, dark: int) -> Counts:
        """Return what a scan of ambient light becomes; `dark` is a reading without any light."""
        for spell in self._lasting(time):
            counts = spell.kind.ambient(counts, dark, spell.fault)
        return counts

    def speeds(self, time: float, speeds: Pair) -> Pair:
        """Return the speeds that the motors would come to."""
        for spell in self._lasting(time):
            speeds = spell.kind.speeds(speeds, spell.fault)
        return speeds

    def slip(self, time: float, slip: Pair) -> Pair:
        """Return the relative errors of the wheels' ways over ground."""
        left, right = 1.0 + slip[0], 1.0 + slip[1]
        for spell in self._lasting(time):
            grip_left, grip_right = spell.kind.grip(spell.fault)
            left, right = left * grip_left, right * grip_right
        return left - 1.0, right - 1.0

    def battery(self, time: float, counts: int) -> int:
        """Return counts of the battery's voltage."""
        for spell in self._lasting(time):
            share = (self._origin + time - spell.begin) / (spell.end - spell.begin)
            counts = round(counts * spell.kind.battery(share))
        return counts

    def heading(self, time: float) -> float:
        """Return radians by which the camera looks further to the left."""
        return radians(sum(spell.kind.heading(spell.fault) for spell in self._lasting(time)))

    def picture(self, time: float, image: Image) -> Image:
        """Return what a picture of the camera becomes."""
        for spell in self._lasting(time):
            image = spell.kind.picture(image, spell.fault)
        return image

    def _lasting(self, time: float) -> list[Spell]:
        now = self._origin + time
        return [spell for spell in self._faults.spells if spell.holds(now)]
