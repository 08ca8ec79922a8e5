r"""Faults of a serial line, and of the robot at its end.

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

and of the robot, for as long as they last, from `at` on or by a request with chance `p`:

    dead-sensor, stuck-sensor, dirty-sensor     infrared: sees nothing, goes on reading what it read
                                                first, gets a part of the light
    weak-motor, jammed-motor, worn-wheel        comes to a part of its speed, stands, goes a part of
                                                the way that it counts
    empty-battery                               the voltage falls, then the robot starts again
    frozen-camera, dark-camera, turned-camera   goes on giving the first picture, gets a part of the
                                                light, looks aside

    key   meaning                                                       without it
    p     chance, 0 to 1                                                1 (see above)
    n     so many times at most                                         no limit
    dir   request (to the robot), reply (to the client) or both         both
    at    seconds on the robot's clock since it was switched on or
          reset with a seed: not before                                 0
    for   seconds from `at` on; how long a stall or a cut lasts         for ever; 1
    time  seconds of a delay                                            0.05
    text  what strays in, with escapes such as \r\n; the last key       stray\r\n
    sensor  number of an infrared sensor, 0 to 7                        all
    wheel   left, right or both                                         both
    part    of what was, 0 to 1                                         depends on the kind
    angle   degrees that the camera turns to the left                   15

Kinds are found in the registry `FAULTS`: the bundled ones are in `fault_kinds` and
`robot.robot_faults`; others come from other distributions or files, as
`--fault my_file.py:Burst:p=0.01`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, StrEnum
from math import inf
from typing import Any, Final, Protocol

from khepera_protocol.registry import Registry
from khepera_protocol.text import printable

from khepera_emulator.doors import find_part
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.clock import on_grid

FAULTS: Final = Registry(
    "kind of fault",
    "khepera_macor.faults",
    {
        "drop": "khepera_emulator.line.fault_kinds:Drop",
        "flip": "khepera_emulator.line.fault_kinds:Flip",
        "duplicate": "khepera_emulator.line.fault_kinds:Duplicate",
        "delay": "khepera_emulator.line.fault_kinds:Delay",
        "truncate": "khepera_emulator.line.fault_kinds:Truncate",
        "stray": "khepera_emulator.line.fault_kinds:Stray",
        "stall": "khepera_emulator.line.fault_kinds:Stall",
        "cut": "khepera_emulator.line.fault_kinds:Cut",
        "reset": "khepera_emulator.line.fault_kinds:Reset",
        "dead-sensor": "khepera_emulator.robot.robot_faults:DeadSensor",
        "stuck-sensor": "khepera_emulator.robot.robot_faults:StuckSensor",
        "dirty-sensor": "khepera_emulator.robot.robot_faults:DirtySensor",
        "weak-motor": "khepera_emulator.robot.robot_faults:WeakMotor",
        "jammed-motor": "khepera_emulator.robot.robot_faults:JammedMotor",
        "worn-wheel": "khepera_emulator.robot.robot_faults:WornWheel",
        "empty-battery": "khepera_emulator.robot.robot_faults:EmptyBattery",
        "frozen-camera": "khepera_emulator.robot.robot_faults:FrozenCamera",
        "dark-camera": "khepera_emulator.robot.robot_faults:DarkCamera",
        "turned-camera": "khepera_emulator.robot.robot_faults:TurnedCamera",
    },
)

DELAY: Final = on_grid(0.05)
STRAY: Final = b"stray\r\n"
ANGLE: Final = 15.0


class Direction(StrEnum):
    """Way that a byte goes: to the robot or to the client."""

    REQUEST = "request"
    REPLY = "reply"


BOTH: Final = (Direction.REQUEST, Direction.REPLY)


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault, as it was asked for.

    Attributes:
        kind: a name in `FAULTS`.
        chance: of every byte, request or reply; None: once, at a time.
        directions: which ways it works.
        at: seconds since the robot was switched on: not before.
        lasts: seconds from then on; for a stall or a cut how long each one lasts.
        time: seconds of a delay.
        text: what strays in.
        most: so many times at most.
        sensor: number of an infrared sensor; None: all of them.
        wheel: left, right or both.
        part: of what was; None: what is usual of the kind.
        angle: degrees that a camera turns to the left.
    """

    kind: str
    chance: float | None = 1.0
    directions: tuple[Direction, ...] = BOTH
    at: float = 0.0
    lasts: float = inf
    time: float = DELAY
    text: bytes = STRAY
    most: float = inf
    sensor: int | None = None
    wheel: str = "both"
    part: float | None = None
    angle: float = ANGLE

    def part_or(self, usual: float) -> float:
        """Return the part that was asked for, or the usual one."""
        return usual if self.part is None else self.part


@dataclass(frozen=True, slots=True)
class Happening:
    """A fault that has happened: when on the robot's clock, which way, which one and what."""

    time: float
    direction: Direction
    kind: str
    what: str

    def __str__(self) -> str:
        return f"{self.time:.6f} s, {self.direction}: {self.kind}: {self.what}"


class Victim(Enum):
    """Whatever a kind of faults strikes, and draws its chance for."""

    BYTE = "byte"
    REPLY = "reply"
    REQUEST = "request"
    ROBOT = "robot"
    """The robot itself; chance is drawn by each request."""


@dataclass(slots=True)
class Passing:
    """A byte on its way past the faults of a line.

    Attributes:
        byte: its value.
        copies: how often it comes; 0: not at all.
        late: seconds by which it, and all behind it, are late.
        each: seconds that a byte takes on the wire.
    """

    byte: int
    copies: int
    late: float
    each: float


class Kind(Protocol):
    """A kind of faults; one is made for each fault, without arguments, whenever a line begins.

    Attributes:
        victim: what it strikes.
        keys: what may be written of it, of the keys above.
        once: whether it happens once, at `at`, where no `p` is given.
    """

    victim: Victim
    keys: tuple[str, ...]
    once: bool


class ByteKind(Kind, Protocol):
    """A kind that strikes bytes."""

    def bend(self, passing: Passing, share: float, fault: Fault) -> str:
        """Change a byte on its way, and tell what has happened to it.

        Args:
            passing: the byte.
            share: a random number, 0 to below 1, to choose with.
            fault: as it was asked for.
        """


class ReplyKind(Kind, Protocol):
    """A kind that strikes replies."""

    def change(self, reply: bytes, share: float, fault: Fault) -> tuple[bytes, str]:
        """Return what becomes of a reply, empty for one that happens at a time, and tell it."""


class Effect(Enum):
    """Whatever a fault that strikes requests does to the line or the robot."""

    STALL = "stall"
    CUT = "cut"
    RESET = "reset"


class RequestKind(Kind, Protocol):
    """A kind that strikes requests.

    Attributes:
        effect: on the line, for as long as the fault lasts; or on the robot.
    """

    effect: Effect


@dataclass(frozen=True, slots=True)
class Spell:
    """A time in which a fault lasts.

    Attributes:
        kind: of the fault, made for this time.
        fault: as it was asked for.
        begin, end: seconds on the robot's clock.
    """

    kind: Any
    fault: Fault
    begin: float
    end: float

    def holds(self, when: float) -> bool:
        """Tell whether it lasts at a time."""
        return self.begin <= when < self.end


Listener = Callable[[Happening], None]


def find_kind(name: str) -> Any:
    """Return the class of a kind of faults.

    Raises:
        EmulatorError: there is none of that name.
    """
    kind = find_part(FAULTS, name)
    if not isinstance(getattr(kind, "victim", None), Victim):
        raise EmulatorError(
            f"'{printable(name, 200)}' is not a kind of fault: its attribute `victim` is not a"
            " Victim"
        )
    return kind


def split_kind(text: str) -> tuple[str, str]:
    """Split `KIND:KEY=VALUE,...` behind the kind.

    A kind with a dot or a slash in it is `package.module:Class` or `file.py:Class`.
    """
    kind, _, rest = text.partition(":")
    if "." in kind or "/" in kind:
        attribute, _, rest = rest.partition(":")
        kind = f"{kind}:{attribute}"
    return kind, rest
