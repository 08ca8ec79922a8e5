"""A robot that pushes against what stands fast: its velocity after a period, by impulses.

The body is a disc on two wheels. Each tyre holds its point of contact on the floor as firmly as
friction allows, in whatever direction it slips (Coulomb); a wall takes the part of the motion
that goes into it, and rubs. All impulses of a period are found one after the other, again and
again until they no longer change (projected Gauss-Seidel). They begin with those of the period
before, so that a robot that goes on pushing needs two or three turns.

Everything is in the robot's own frame: ahead, to the left, counter-clockwise. PyBullet, which does
the same for the whole body in space, is the reference; see tests/test_contact.py.
"""

from collections.abc import Sequence
from math import hypot
from typing import NamedTuple

from khepera_protocol.serial.units import CONTROL_PERIOD

from khepera_emulator.models import Model

GRAVITY = 9.81

_TYRE = 1.0
"""Friction of tyres on the floor; each wheel carries half the weight."""

_WALL = 0.06
"""Friction of the body on walls, the same that it has in PyBullet."""

_HEIGHT = 0.004
"""Metres above the floor at which walls push: the hull's lower edge. What the tyres do against it
at the floor leans the robot over, and loads the wheel away from the wall more."""

_PUSH_OUT = 0.2
"""Part of a penetration that is undone in a period."""

_TURNS = 40
_ACCURACY = 1e-3
"""Change of an impulse, over what a tyre can do, that ends the search."""

_SLIPPING = 1e-4
"""m/s that a tyre may slip and still count as holding."""


class Touch(NamedTuple):
    """Something in the way.

    Attributes:
        gap: metres between it and the body; less than 0 inside.
        ahead, left: unit vector from the body straight at it.
    """

    gap: float
    ahead: float
    left: float


class Motion(NamedTuple):
    """Velocity of the middle between the wheels ahead and to the left (m/s), and rate (rad/s)."""

    ahead: float
    left: float
    rate: float


_Moves = tuple[float, float, float]
"""A `Motion`, as a plain tuple."""

_Impulse = tuple[float, float]
"""Impulse of a wall: towards the body, and along it."""

_Tyres = tuple[float, float, float, float]


class Contact:
    """Impulses between a robot, the floor and what is in its way.

    Args:
        model: of the robot.
        wheel_base: metres between its wheels.

    Attributes:
        pressing: whether anything was pushed in the last period.
        slipping: whether a tyre slipped at its end.
    """

    def __init__(self, model: Model, wheel_base: float) -> None:
        mass = model.mass
        arm = wheel_base / 2
        # a hull of four fifths of the mass, and two wheels
        inertia = 0.4 * mass * model.radius**2 + 0.2 * mass * arm**2
        self._mass = mass
        light, turns = 1.0 / mass, 1.0 / inertia
        self.light, self.arm, self._radius = light, arm, model.radius
        self.turns_arm, self.turns_radius = turns * arm, turns * model.radius
        # impulses for each m/s of slip; the same ahead as aside, so that friction opposes the slip
        self.stiff = 1.0 / (light + arm * self.turns_arm)
        self.rub = 1.0 / (light + model.radius * self.turns_radius)
        self.hold = _TYRE * mass * GRAVITY / 2 * CONTROL_PERIOD
        self.tolerance = _ACCURACY * self.hold
        self.lean = _TYRE * _HEIGHT / (2 * arm)
        self.forget()

    def forget(self) -> None:
        """Begin anew: nothing has been pushed before."""
        self.pressing = self.slipping = False
        self.tyres: _Tyres = (0.0, 0.0, 0.0, 0.0)
        self.walls: list[_Impulse] = []

    def push(self, motion: Motion, wheels: tuple[float, float], touches: Sequence[Touch]) -> Motion:
        """Return the motion at the end of a period.

        Args:
            motion: at its beginning.
            wheels: m/s of left and right wheel over ground, if nothing slipped.
            touches: what is in the way.
        """
        moves, walls = self._begin(motion, touches)
        limits = [(gap if gap > 0.0 else _PUSH_OUT * gap) / CONTROL_PERIOD for gap, _, _ in touches]
        tyres = self.tyres
        tolerance = self.tolerance
        for _ in range(_TURNS):
            moves, lean, change = self._press(moves, touches, limits, walls)
            moves, tyres, change = self._grip(moves, tyres, wheels, lean, change)
            if change < tolerance:
                break
        self.tyres, self.walls = tyres, walls
        self.pressing = any(press > 0.0 for press, _ in walls)
        ahead, left, rate = moves
        slip = abs(left) + abs(ahead - self.arm * rate - wheels[0])
        self.slipping = slip + abs(ahead + self.arm * rate - wheels[1]) > _SLIPPING
        return Motion(ahead, left, rate)

    def _begin(self, motion: Motion, touches: Sequence[Touch]) -> tuple[_Moves, list[_Impulse]]:
        """Apply the impulses of the period before; return the motion and those of the walls."""
        light, turns_radius = self.light, self.turns_radius
        ahead, left, rate = motion
        al, ll, ar, lr = self.tyres
        walls = self.walls
        if len(walls) != len(touches):
            walls = [(0.0, 0.0)] * len(touches)
        ahead += light * (al + ar)
        left += light * (ll + lr)
        rate += self.turns_arm * (ar - al)
        for (_, to_ahead, to_left), (press, drag) in zip(touches, walls, strict=True):
            ahead -= light * (press * to_ahead + drag * to_left)
            left -= light * (press * to_left - drag * to_ahead)
            rate += turns_radius * drag
        return (ahead, left, rate), list(walls)

    def _press(
        self,
        moves: _Moves,
        touches: Sequence[Touch],
        limits: Sequence[float],
        walls: list[_Impulse],
    ) -> tuple[_Moves, float, float]:
        """Let every wall push and rub, one after the other.

        Args:
            moves: the motion so far.
            touches: what is in the way.
            limits: m/s towards each that leave it alone.
            walls: impulses of each; they change.

        Returns:
            The motion, how far the robot leans to the left, and how much the impulses changed.
        """
        light, radius, mass = self.light, self._radius, self._mass
        turns_radius, rub = self.turns_radius, self.rub
        ahead, left, rate = moves
        change = lean = 0.0
        for number, (_, to_ahead, to_left) in enumerate(touches):
            before, drag_before = walls[number]
            press = before + (ahead * to_ahead + left * to_left - limits[number]) * mass
            if press < 0.0:
                press = 0.0
            most = _WALL * press
            step = press - before
            ahead -= light * step * to_ahead
            left -= light * step * to_left
            drag = drag_before - (left * to_ahead - ahead * to_left + radius * rate) * rub
            drag = most if drag > most else -most if drag < -most else drag
            walls[number] = press, drag
            change += abs(step)
            lean += press * to_left
            step = drag - drag_before
            ahead -= light * step * to_left
            left += light * step * to_ahead
            rate += turns_radius * step
        return (ahead, left, rate), lean, change

    def _grip(
        self,
        moves: _Moves,
        tyres: _Tyres,
        wheels: tuple[float, float],
        lean: float,
        change: float,
    ) -> tuple[_Moves, _Tyres, float]:
        """Let the left tyre hold its point on the floor, then the right one.

        Args:
            moves: the motion so far.
            tyres: impulses of left and right tyre, ahead and to the left.
            wheels: m/s over ground of the wheels.
            lean: impulse by which walls lean the robot to the left.
            change: of impulses, so far in this turn.

        Returns:
            The motion, the tyres' impulses, and how much all impulses changed in this turn.
        """
        light, arm, hold = self.light, self.arm, self.hold
        turns_arm, stiff = self.turns_arm, self.stiff
        ahead, left, rate = moves
        al, ll, ar, lr = tyres
        lean *= self.lean
        lean = hold if lean > hold else -hold if lean < -hold else lean
        most = hold - lean
        a, b = al - stiff * (ahead - arm * rate - wheels[0]), ll - stiff * left
        size = hypot(a, b)
        if size > most:
            a, b = a * most / size, b * most / size
        step, aside = a - al, b - ll
        al, ll = a, b
        ahead += light * step
        left += light * aside
        rate -= turns_arm * step
        change += abs(step) + abs(aside)
        most = hold + lean
        a, b = ar - stiff * (ahead + arm * rate - wheels[1]), lr - stiff * left
        size = hypot(a, b)
        if size > most:
            a, b = a * most / size, b * most / size
        step, aside = a - ar, b - lr
        ahead += light * step
        left += light * aside
        rate += turns_arm * step
        change += abs(step) + abs(aside)
        return (ahead, left, rate), (al, ll, a, b), change
