"""The gripper: an arm that swings two fingers over the robot, down to the floor in front of it.

Numbers of the protocol run from 255 (arm down in front, fingers open) downwards. Pyro drives the
arm between 165 (up) and 255 (lowest), lifts to 175 and puts down at 240, and takes fingers below
100 for closed and a barrier below 100 for "nothing". Where no source says more: choices.
"""

from typing import Final

from khepera_protocol.serial.turrets import TURRETS
from khepera_protocol.serial.units import CONTROL_PERIOD

from khepera_emulator.turrets.turret import Piece, Point, Site, Values, ticks

ARM_DOWN: Final = 255.0
ARM_UP: Final = 150.0
"""Position of the stop at the back (about 150 to 170); orders below it stop there."""

ARM_RATE: Final = (ARM_DOWN - ARM_UP) / 1.0
"""Positions a second: one second over the whole range."""

FINGER_RATE: Final = 255.0 / 0.6
"""Positions a second: 0.6 s from open to closed (k2py waits that long)."""

REACH: Final = 230.0
"""Arm position from which on the fingers are beside what stands on the floor (a choice)."""

OPENING: Final = 0.050
"""Metres between the open fingers (a choice)."""

JAW: Final = 0.020
"""Metres from the body's edge to the fingers, arm down (a choice)."""

BEAM_BROKEN: Final = 255
"""Reading of the optical barrier with something in its beam; 0 without."""


class Gripper:
    """The gripper of one robot.

    Attributes:
        arm: position, `ARM_UP` to 255.
        fingers: 0 closed to 255 open.
        held: what the closed fingers hold.
        lifted: whether that has left the floor.
        jumpers: setting of the jumpers.
    """

    kind = TURRETS["gripper"]

    def __init__(self, site: Site) -> None:
        self._site = site
        self._tick = 0
        self.jumpers = 0
        self.held: Piece | None = None
        self.lifted = False
        self.power_on()

    def power_on(self) -> None:
        """Begin with the arm up, the fingers open and empty (choices)."""
        self._release()
        self.arm = self._arm_target = ARM_UP
        self.fingers = self._finger_target = 255.0

    def step(self, now: float) -> None:
        """Move arm and fingers; look whether what is held stays."""
        due = ticks(now)
        # in control periods, so that the way is the same however long nobody looked
        while self._tick < due and self._busy():
            self._tick += 1
            self.arm = _approach(self.arm, self._arm_target, ARM_RATE)
            self._hold()
            self._move_fingers()
        self._tick = due
        self._hold()

    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        """Carry out a message; moves begin and the reply comes at once."""
        del now  # nothing but moves takes time, and those are stepped
        match letter:
            case "B":
                return 1, 0
            case "D":
                self._finger_target = 0.0 if arguments[0] else 255.0
                return ()
            case "E":
                self._arm_target = max(float(arguments[0]), ARM_UP)
                return ()
            case "F":
                return (self.held.resistivity if self.held else 0,)
            case "G":
                return (BEAM_BROKEN if self._beam_broken() else 0,)
            case "H":
                return (round(self.arm if arguments[0] else self.fingers),)
            case _:
                return (self.jumpers,)

    def _busy(self) -> bool:
        closing = self._finger_target < self.fingers and self.held is None
        return self.arm != self._arm_target or closing or self.fingers < self._finger_target

    def _move_fingers(self) -> None:
        target = self._finger_target
        if target > self.fingers:
            self._release()
        thing = self.held or self._thing()
        if thing is not None and target < self.fingers:
            stop = min(thing.width / OPENING, 1.0) * 255.0
            if self.fingers >= stop:
                # held only where the fingers reach it on this way, not what is in front of them
                target = max(target, stop)
                self.fingers = _approach(self.fingers, target, FINGER_RATE)
                if self.fingers == stop and self.held is None:
                    self.held = thing
                return
        self.fingers = _approach(self.fingers, target, FINGER_RATE)

    def _hold(self) -> None:
        """Let a held thing go up with the arm, or stay where it is and slip out."""
        if self.held is None:
            return
        if self.lifted:
            self._site.things.carry(self.held, self._jaw(0.0))
            return
        if self.arm < REACH:
            self.lifted = self._site.things.lift(self.held)
            if not self.lifted:
                self.held = None
        elif self._thing() is None:
            self.held = None

    def _release(self) -> None:
        if self.held is not None and self.lifted:
            self._site.things.put(self.held, self._jaw(0.0))
        self.held, self.lifted = None, False

    def _beam_broken(self) -> bool:
        if self.held is not None:
            return True
        thing = self._thing()
        return thing is not None and thing.width / OPENING * 255.0 <= self.fingers

    def _thing(self) -> Piece | None:
        """Find what stands between the fingers, if they are down."""
        if self.arm < REACH:
            return None
        return self._site.things.between(self._jaw(OPENING / 2), self._jaw(-OPENING / 2))

    def _jaw(self, left: float) -> Point:
        return self._site.ahead(self._site.radius + JAW, left)


def _approach(value: float, target: float, rate: float) -> float:
    """Return one control period's way towards a target, `rate` positions a second."""
    way = rate * CONTROL_PERIOD
    return min(max(target, value - way), value + way)
