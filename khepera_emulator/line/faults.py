r"""Faults of a serial line: bytes lost, bent or late, replies cut short, the plug pulled.

A fault is written `KIND:KEY=VALUE,...`, for example `drop:p=0.01,dir=reply` or `cut:at=12,for=2`.

    kind       what happens                                       to
    drop       it is lost, its time on the wire passes            each byte
    flip       one of its bits changes                            each byte
    duplicate  it comes twice                                     each byte
    delay      it and all behind it come `time` seconds later     each byte
    truncate   all behind a random place is lost                  each reply
    stray      `text` comes ahead of it; without p: once, at `at` each reply
    stall      the line stands still for `for` seconds            each request; without p: at `at`
    cut        bytes in both directions are lost for `for` s      each request; without p: at `at`
    reset      the robot starts again in mid-command: what it     each request; without p: at `at`
               has received and not yet said is lost, and its
               banner comes

    key   meaning                                                       without it
    p     chance, 0 to 1                                                1 (see above)
    n     so many times at most                                         no limit
    dir   request (to the robot), reply (to the client) or both         both
    at    seconds on the robot's clock since it was switched on or
          reset with a seed: not before                                 0
    for   seconds from `at` on; how long a stall or a cut lasts         for ever; 1
    time  seconds of a delay                                            0.05
    text  what strays in, with escapes such as \r\n; the last key       stray\r\n

Chance is drawn once a byte, request or reply, whatever else happens: with the same seed the same
bytes are hit. No I/O: times and bytes come in, times and bytes go out.
"""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from math import inf
from random import Random
from typing import Final

from khepera_protocol.text import printable

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.clock import on_grid


class Direction(StrEnum):
    """Which way a byte goes: to the robot or to the client."""

    REQUEST = "request"
    REPLY = "reply"


_BOTH: Final = (Direction.REQUEST, Direction.REPLY)
_BYTES: Final = ("drop", "flip", "duplicate", "delay")
_REPLIES: Final = ("truncate", "stray")
_REQUESTS: Final = ("stall", "cut", "reset")
_WINDOWS: Final = ("stall", "cut")
_AT_A_TIME: Final = ("stray", *_REQUESTS)
KINDS: Final = (*_BYTES, *_REPLIES, *_REQUESTS)

MAX_SCRIPT: Final = 1_000_000
"""Bytes of the longest schedule that is read."""

MOST_FAULTS: Final = 1000
"""Faults of one line: each draws a number for every byte."""

_LONGEST: Final = 1000
"""Characters of a fault as it is written."""

_SHOWN: Final = 100
_MOST_SECONDS: Final = 2.0**23
"""97 days, for which the times on the line are exact."""

_MOST_TIMES: Final = 1e9

_DELAY: Final = on_grid(0.05)
_LASTS: Final = 1.0
_TEXT: Final = b"stray\r\n"


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault, as it was asked for.

    Attributes:
        kind: one of `KINDS`.
        chance: of every byte, request or reply; None: once, at a time.
        directions: which ways it works.
        at: seconds since the robot was switched on: not before.
        lasts: seconds from then on; for a stall or a cut how long each one lasts.
        time: seconds of a delay.
        text: what strays in.
        most: so many times at most.
    """

    kind: str
    chance: float | None = 1.0
    directions: tuple[Direction, ...] = _BOTH
    at: float = 0.0
    lasts: float = inf
    time: float = _DELAY
    text: bytes = _TEXT
    most: float = inf


@dataclass(frozen=True, slots=True)
class Happening:
    """A fault that has happened: when on the robot's clock, which way, which one and what."""

    time: float
    direction: Direction
    kind: str
    what: str

    def __str__(self) -> str:
        return f"{self.time:.6f} s, {self.direction}: {self.kind}: {self.what}"


Timed = tuple[float, int]
"""When a byte arrives, and the byte."""


class Faults:
    """The faults of one line, in time.

    Args:
        faults: what is asked for.
        seed: of their chance.
        tell: called with every happening.

    Attributes:
        listeners: who is called with every happening.
    """

    def __init__(
        self,
        faults: Iterable[Fault] = (),
        seed: int = 0,
        tell: Callable[[Happening], None] | None = None,
    ) -> None:
        self.listeners = [tell] if tell else []
        self._faults = tuple(faults)
        self.begin(seed)

    def begin(self, seed: int, now: float = 0.0) -> None:
        """Begin anew: chance from a seed, times counted from now."""
        self._active = [
            _Active(fault, place, seed, now) for place, fault in enumerate(self._faults)
        ]
        self._bytes = [active for active in self._active if active.kind in _BYTES]
        once = [active for active in self._active if active.fault.chance is None]
        self._moments = deque(sorted(once, key=lambda active: active.at))
        self._windows = [_window(active, active.at) for active in once if active.kind in _WINDOWS]

    def __bool__(self) -> bool:
        """Whether there is any fault."""
        return bool(self._faults)

    def next_moment(self) -> float | None:
        """When the next fault that has a time of its own happens."""
        return self._moments[0].at if self._moments else None

    def take_moment(self) -> tuple[float, str, bytes]:
        """That fault: its time, its kind and the text that strays in."""
        active = self._moments.popleft()
        self._tell(active.at, active.fault.directions[-1], active.kind, active.story())
        return active.at, active.kind, active.fault.text

    def on_bytes(
        self, direction: Direction, items: Sequence[Timed], each: float
    ) -> tuple[list[Timed], float]:
        """What becomes of bytes that would arrive at their times.

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
        """A request is about to be carried out; returns whether the robot resets instead."""
        reset = False
        for active in self._active:
            if active.kind not in _REQUESTS or active.fault.chance is None:
                continue
            if active.strikes(Direction.REQUEST, when) is None:
                continue
            self._tell(when, Direction.REQUEST, active.kind, active.story())
            if active.kind == "reset":
                reset = True
            else:
                self._open(active, when)
        return reset

    def on_reply(self, when: float, reply: bytes) -> bytes:
        """What becomes of a reply as a whole."""
        for active in self._active:
            if active.kind not in _REPLIES or active.fault.chance is None:
                continue
            share = active.strikes(Direction.REPLY, when)
            if share is None:
                continue
            if active.kind == "stray":
                self._tell(when, Direction.REPLY, "stray", active.story())
                reply = active.fault.text + reply
            else:
                kept = int(share * len(reply))
                self._tell(when, Direction.REPLY, "truncate", f"{reply[kept:]!r} lost")
                reply = reply[:kept]
        return reply

    def _bend(
        self, direction: Direction, when: float, byte: int, late: float, each: float
    ) -> tuple[int, int, float]:
        """One byte past the faults of bytes: how often it comes, as what, and how late."""
        copies = 1
        for active in self._bytes:
            share = active.strikes(direction, when + late)
            if share is None:
                continue
            what = repr(bytes((byte,)))
            if active.kind == "drop":
                copies = 0
            elif active.kind == "flip":
                byte ^= 1 << int(share * 8)
                what = f"{what} becomes {bytes((byte,))!r}"
            elif active.kind == "duplicate":
                copies += copies > 0
                late += each
            else:
                late += active.fault.time
                what = f"{what} {active.fault.time:g} s late"
            self._tell(when + late, direction, active.kind, what)
        return copies, byte, late

    def _open(self, active: "_Active", when: float) -> None:
        ahead = [window for window in self._windows if window.end > when]
        self._windows = [*ahead, _window(active, when)]

    def _standstill(self, direction: Direction, when: float) -> float:
        """Seconds that a byte has to wait until the line moves again."""
        begin = when
        for window in self._windows:
            if window.kind == "stall" and window.holds(direction, when):
                when = window.end
        return when - begin

    def _is_cut(self, direction: Direction, when: float, byte: int) -> bool:
        cut = any(each.kind == "cut" and each.holds(direction, when) for each in self._windows)
        if cut:
            self._tell(when, direction, "cut", f"{bytes((byte,))!r} lost")
        return cut

    def _tell(self, when: float, direction: Direction, kind: str, what: str) -> None:
        happening = Happening(when, direction, kind, what)
        for listener in self.listeners:
            listener(happening)


@dataclass(frozen=True, slots=True)
class _Window:
    """A time in which the line stands still or is cut."""

    kind: str
    directions: tuple[Direction, ...]
    begin: float
    end: float

    def holds(self, direction: Direction, when: float) -> bool:
        return self.begin <= when < self.end and direction in self.directions


class _Active:
    """A fault with its chance and its times on the robot's clock."""

    def __init__(self, fault: Fault, place: int, seed: int, origin: float) -> None:
        self.fault = fault
        self.kind = fault.kind
        self.at = origin + fault.at
        lasts = inf if fault.kind in _WINDOWS else fault.lasts
        self._end = self.at + lasts
        self._left = fault.most
        # a generator for each direction: how their bytes mix in time makes no difference
        # a line stands still because of a request, whichever way it then stands still
        directions = (Direction.REQUEST,) if fault.kind in _REQUESTS else fault.directions
        self._draws = {
            direction: Random(f"{seed}/{place}/{fault.kind}/{direction}").random
            for direction in directions
        }

    def strikes(self, direction: Direction, when: float) -> float | None:
        """Whether it happens now: a number from 0 to below 1 to choose a place with, or None."""
        draw = self._draws.get(direction)
        if draw is None:
            return None
        number = draw()
        chance = self.fault.chance or 0.0
        if number >= chance or not self.at <= when < self._end or self._left <= 0:
            return None
        self._left -= 1
        return number / chance

    def story(self) -> str:
        """What happens, for the log."""
        if self.kind == "stray":
            return repr(self.fault.text)
        return "the robot starts again" if self.kind == "reset" else f"{self.fault.lasts:g} s"


def _window(active: _Active, begin: float) -> _Window:
    fault = active.fault
    return _Window(fault.kind, fault.directions, begin, begin + fault.lasts)


def parse_fault(text: str) -> Fault:
    r"""Read `KIND:KEY=VALUE,...`.

    Raises:
        EmulatorError: it is no fault; the message says why.
    """
    if len(text) > _LONGEST:
        raise _wrong(text, f"it has {len(text):,} characters, and {_LONGEST:,} at most are read")
    kind, _, rest = text.partition(":")
    if kind not in KINDS:
        raise _wrong(text, f"there are {', '.join(KINDS)}")
    values = _values(text, rest)
    allowed = _allowed(kind)
    for key in values:
        if key not in allowed:
            raise _wrong(text, f"{kind} knows {', '.join(allowed)}, not '{_shown(key)}'")
    once = kind in _AT_A_TIME and "p" not in values
    if once and "at" not in values:
        raise _wrong(text, f"{kind} needs p (a chance) or at (a time)")
    fault = Fault(
        kind,
        chance=None if once else _number(text, "p", values.get("p", "1"), 1.0),
        directions=_directions(text, kind, values.get("dir", "both")),
        at=_seconds(text, "at", values.get("at", "0")),
        time=_seconds(text, "time", values.get("time", str(_DELAY))),
        most=_number(text, "n", values["n"], _MOST_TIMES) if "n" in values else inf,
    )
    if "text" in values:
        fault = replace(fault, text=_unescape(text, values["text"]))
    if kind in _WINDOWS:
        return replace(fault, lasts=_seconds(text, "for", values.get("for", str(_LASTS))))
    return replace(fault, lasts=_seconds(text, "for", values["for"])) if "for" in values else fault


def parse_faults(specs: Sequence[str]) -> tuple[Fault, ...]:
    """Read the faults of one line.

    Raises:
        EmulatorError: one of them is none, or there are too many.
    """
    if len(specs) > MOST_FAULTS:
        raise EmulatorError(
            f"there are {len(specs):,} faults, and a line takes {MOST_FAULTS:,} at most"
        )
    return tuple(map(parse_fault, specs))


def parse_script(text: str) -> tuple[Fault, ...]:
    """Read a schedule: `TIME FAULT` a line, where TIME stands for `at`; # begins a comment.

    Raises:
        EmulatorError: a line is neither; the message gives its number.
    """
    return tuple(map(parse_fault, script_specs(text)))


def script_specs(text: str) -> list[str]:
    """The faults of a schedule, each as `parse_fault` reads it; errors as of `parse_script`."""
    if len(text) > MAX_SCRIPT:
        raise EmulatorError(f"the fault script has more than {MAX_SCRIPT:,} characters")
    specs: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        line = line.strip()
        if not line or line.startswith("#"):
            continue
        time, _, spec = line.partition(" ")
        kind, _, rest = spec.strip().partition(":")
        # `at` comes first: a text is the last key
        spec = f"{kind}:at={time}" + (f",{rest}" if rest else "")
        try:
            parse_fault(spec)
        except EmulatorError as error:
            raise EmulatorError(f"line {number} of the fault script: {error}") from None
        specs.append(spec)
        if len(specs) > MOST_FAULTS:
            raise EmulatorError(f"the fault script has more than {MOST_FAULTS:,} faults")
    return specs


def _allowed(kind: str) -> tuple[str, ...]:
    if kind in _BYTES:
        return ("p", "n", "dir", "at", "for", *(("time",) if kind == "delay" else ()))
    if kind in _REPLIES:
        return ("p", "n", "at", "for", *(("text",) if kind == "stray" else ()))
    if kind == "reset":
        return ("p", "n", "at")
    return ("p", "n", "at", "for", *(("dir",) if kind == "stall" else ()))


def _values(text: str, rest: str) -> dict[str, str]:
    values: dict[str, str] = {}
    while rest:
        key, equals, rest = rest.partition("=")
        if not equals:
            raise _wrong(text, f"'{_shown(key)}' is no KEY=VALUE")
        if key in values:
            raise _wrong(text, f"{_shown(key)} is given twice")
        values[key], _, rest = (rest, "", "") if key == "text" else rest.partition(",")
    return values


def _directions(text: str, kind: str, word: str) -> tuple[Direction, ...]:
    if kind in _REPLIES:
        return (Direction.REPLY,)
    if word == "both":
        return _BOTH
    if word not in tuple(Direction):
        raise _wrong(text, f"dir is request, reply or both, not '{_shown(word)}'")
    return (Direction(word),)


def _seconds(text: str, key: str, word: str) -> float:
    return on_grid(_number(text, key, word, _MOST_SECONDS))


def _number(text: str, key: str, word: str, most: float) -> float:
    try:
        number = float(word)
    except ValueError:
        raise _wrong(text, f"{key}={_shown(word)} is no number") from None
    if not 0.0 <= number <= most:  # nor is it NaN
        raise _wrong(text, f"{key}={_shown(word)} is out of range: give 0 to {most:.10g}")
    return number


def _unescape(text: str, word: str) -> bytes:
    try:
        return word.encode("ascii").decode("unicode_escape").encode("latin-1")
    except UnicodeError:
        raise _wrong(text, f"text={_shown(word)}: give ASCII with escapes such as \\xff") from None


def _wrong(text: str, why: str) -> EmulatorError:
    return EmulatorError(f"cannot read the fault '{_shown(text)}': {why}")


def _shown(text: str) -> str:
    return printable(text, _SHOWN)
