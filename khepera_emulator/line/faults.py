"""The faults of one line in time: which strike when, and what becomes of bytes and replies.

Chance is drawn once a byte, request or reply, whatever else happens: with the same seed the same
bytes are hit. No I/O: times and bytes come in, times and bytes go out.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from math import inf
from random import Random
from typing import Any, Final, NamedTuple

from khepera_emulator.line.fault import (
    Direction,
    Effect,
    Fault,
    Happening,
    Listener,
    Passing,
    Spell,
    Victim,
    find_kind,
)

Timed = tuple[float, int]
"""Time at which a byte arrives, and the byte."""

_BY_REQUESTS: Final = (Victim.REQUEST, Victim.ROBOT)


class Faults:
    """The faults of one line, in time.

    Args:
        faults: what is asked for.
        seed: of their chance.
        tell: called with every happening.

    Attributes:
        listeners: who is called with every happening.
        spells: of the robot's own faults, those that have begun or will at a time.
    """

    def __init__(
        self,
        faults: Iterable[Fault] = (),
        seed: int = 0,
        tell: Listener | None = None,
    ) -> None:
        self.listeners = [tell] if tell else []
        self._seed = seed
        self._made = 0
        self._faults = tuple(faults)
        self.begin(seed)

    def begin(self, seed: int, now: float = 0.0) -> None:
        """Begin anew: chance from a seed, times counted from now."""
        self._seed, self._made = seed, len(self._faults)
        self._active = [
            _Active(fault, place, seed, now) for place, fault in enumerate(self._faults)
        ]
        self._bytes = [active for active in self._active if active.victim is Victim.BYTE]
        once = [active for active in self._active if active.fault.chance is None]
        moments = [_Moment(active.at, active, begins=True) for active in once]
        ending = [active for active in once if active.starts_again_at_end]
        moments += [_Moment(active.at + active.fault.lasts, active) for active in ending]
        self._moments = deque(sorted(moments, key=lambda moment: moment.at))
        self._on_line = [_spell(active, active.at) for active in once if active.on_line]
        self.spells = [_spell(active, active.at) for active in once if active.on_robot]

    def switch_on(self, fault: Fault, now: float) -> None:
        """Add a fault, whose times count from now; the chance of the others stays as it is."""
        active = _Active(fault, self._made, self._seed, now)
        self._made += 1
        self._faults += (fault,)
        self._active.append(active)
        if active.victim is Victim.BYTE:
            self._bytes.append(active)
        if fault.chance is not None:
            return
        moments = [_Moment(active.at, active, begins=True)]
        if active.starts_again_at_end:
            moments.append(_Moment(active.at + fault.lasts, active))
        self._moments = deque(sorted([*self._moments, *moments], key=lambda moment: moment.at))
        if active.on_line:
            self._on_line = [*self._on_line, _spell(active, active.at)]
        if active.on_robot:
            self.spells = [*self.spells, _spell(active, active.at)]

    def switch_off(self, kind: str) -> None:
        """Take away all faults of a kind, those that last at the moment, too."""
        self._faults = tuple(fault for fault in self._faults if fault.kind != kind)
        self._active = [each for each in self._active if each.fault.kind != kind]
        self._bytes = [each for each in self._bytes if each.fault.kind != kind]
        self._moments = deque(each for each in self._moments if each.active.fault.kind != kind)
        self._on_line = [each for each in self._on_line if each.fault.kind != kind]
        self.spells = [each for each in self.spells if each.fault.kind != kind]

    @property
    def count(self) -> int:
        """Number of the faults."""
        return len(self._faults)

    @property
    def kinds(self) -> list[str]:
        """The kinds of all faults, each once."""
        return list(dict.fromkeys(fault.kind for fault in self._faults))

    def __bool__(self) -> bool:
        """Tell whether there is any fault."""
        return bool(self._faults)

    @property
    def befall_robots(self) -> bool:
        """True if some are faults of the robot itself."""
        return any(active.on_robot for active in self._active)

    def next_moment(self) -> float | None:
        """Return when the next fault that has a time of its own happens."""
        return self._moments[0].at if self._moments else None

    def take_moment(self) -> tuple[float, bytes, bool]:
        """Return that fault: its time, what it says, and whether the robot starts again."""
        at, active, begins = self._moments.popleft()
        said, what = active.say() if active.victim is Victim.REPLY else (b"", active.story(begins))
        self._tell(at, active.fault.directions[-1], active.fault.kind, what)
        resets = active.effect is Effect.RESET and begins is not active.starts_again_at_end
        return at, said, resets

    def on_bytes(
        self, direction: Direction, items: Sequence[Timed], each: float
    ) -> tuple[list[Timed], float]:
        """Return what becomes of bytes that would arrive at their times.

        Args:
            direction: which way they go.
            items: times, which never fall, and bytes.
            each: seconds that a byte takes on the wire.

        Returns:
            What arrives, and how many seconds later the line is free.
        """
        passed: list[Timed] = []
        late = 0.0
        for when, byte in items:
            late += self._standstill(direction, when + late)
            copies, byte, late = self._bend(direction, when, byte, late, each)
            if not self._is_cut(direction, when + late, byte):
                passed += [(when + late - each * back, byte) for back in reversed(range(copies))]
        return passed, late

    def on_request(self, when: float) -> bool:
        """Tell whether the robot resets instead of carrying out a request."""
        reset = False
        for active in self._active:
            if active.victim not in _BY_REQUESTS or active.fault.chance is None:
                continue
            if active.strikes(Direction.REQUEST, when) is None:
                continue
            self._tell(when, Direction.REQUEST, active.fault.kind, active.story())
            if active.on_robot:
                self.spells = _with_another(self.spells, active, when)
            elif active.effect is Effect.RESET:
                reset = True
            elif active.on_line:
                self._on_line = _with_another(self._on_line, active, when)
        return reset

    def on_reply(self, when: float, reply: bytes) -> bytes:
        """Return what becomes of a reply as a whole."""
        for active in self._active:
            if active.victim is not Victim.REPLY or active.fault.chance is None:
                continue
            share = active.strikes(Direction.REPLY, when)
            if share is None:
                continue
            reply, what = active.kind.change(reply, share, active.fault)
            self._tell(when, Direction.REPLY, active.fault.kind, what)
        return reply

    def _bend(
        self, direction: Direction, when: float, byte: int, late: float, each: float
    ) -> tuple[int, int, float]:
        """Bring a byte past the faults of bytes: how often it comes, as what, and how late."""
        passing = Passing(byte, 1, late, each)
        for active in self._bytes:
            share = active.strikes(direction, when + passing.late)
            if share is not None:
                what = active.kind.bend(passing, share, active.fault)
                self._tell(when + passing.late, direction, active.fault.kind, what)
        return passing.copies, passing.byte, passing.late

    def _standstill(self, direction: Direction, when: float) -> float:
        """Return seconds that a byte has to wait until the line moves again."""
        begin = when
        for spell in self._on_line:
            if _does(spell, Effect.STALL, direction) and spell.holds(when):
                when = spell.end
        return when - begin

    def _is_cut(self, direction: Direction, when: float, byte: int) -> bool:
        for spell in self._on_line:
            if _does(spell, Effect.CUT, direction) and spell.holds(when):
                self._tell(when, direction, spell.fault.kind, f"{bytes((byte,))!r} lost")
                return True
        return False

    def _tell(self, when: float, direction: Direction, kind: str, what: str) -> None:
        happening = Happening(when, direction, kind, what)
        for listener in self.listeners:
            listener(happening)


class _Moment(NamedTuple):
    """A time at which a fault begins, or ends."""

    at: float
    active: "_Active"
    begins: bool = False


class _Active:
    """A fault with its chance and its times on the robot's clock.

    Attributes:
        at: its first moment on the robot's clock.
        on_line: whether it changes the line for as long as it lasts.
        on_robot: whether it changes the robot for as long as it lasts.
        starts_again_at_end: whether the robot starts again when it ends.
    """

    def __init__(self, fault: Fault, place: int, seed: int, origin: float) -> None:
        self.fault = fault
        self.kind: Any = find_kind(fault.kind)()
        self.victim: Victim = self.kind.victim
        self.effect: Effect | None = getattr(self.kind, "effect", None)
        self.on_line = self.effect in (Effect.STALL, Effect.CUT)
        self.on_robot = self.victim is Victim.ROBOT
        self.starts_again_at_end = self.on_robot and self.effect is Effect.RESET
        self.at = origin + fault.at
        # what lasts by itself may happen again and again
        lasting = self.on_line or self.on_robot
        self._end = inf if lasting else self.at + fault.lasts
        self._left = fault.most
        # a generator for each direction: how their bytes mix in time makes no difference
        # a line stands still because of a request, whichever way it then stands still
        of_requests = self.victim in _BY_REQUESTS
        directions = (Direction.REQUEST,) if of_requests else fault.directions
        name = fault.kind.rpartition(":")[2]
        self._draws = {
            direction: Random(f"{seed}/{place}/{name}/{direction}").random
            for direction in directions
        }

    def strikes(self, direction: Direction, when: float) -> float | None:
        """Draw whether it happens now: a number, 0 to below 1, to choose a place with, or None."""
        draw = self._draws.get(direction)
        if draw is None:
            return None
        number = draw()
        chance = self.fault.chance or 0.0
        if number >= chance or not self.at <= when < self._end or self._left <= 0:
            return None
        self._left -= 1
        return number / chance

    def say(self) -> tuple[bytes, str]:
        """Return what comes at the fault's time, and how that is told."""
        said: tuple[bytes, str] = self.kind.change(b"", 0.0, self.fault)
        return said

    def story(self, begins: bool = True) -> str:
        """Return what a fault of requests or of the robot does, for the log."""
        if not begins or not (self.on_line or self.on_robot):
            return "the robot starts again"
        return f"{self.fault.lasts:g} s" if self.fault.lasts < inf else "for good"


def _spell(active: _Active, begin: float) -> Spell:
    # one that happens again begins anew
    kind = find_kind(active.fault.kind)()
    return Spell(kind, active.fault, begin, begin + active.fault.lasts)


def _with_another(spells: list[Spell], active: _Active, begin: float) -> list[Spell]:
    """Return spells that are not over, and one that begins now."""
    return [*(spell for spell in spells if spell.end > begin), _spell(active, begin)]


def _does(spell: Spell, effect: Effect, direction: Direction) -> bool:
    return spell.kind.effect is effect and direction in spell.fault.directions
