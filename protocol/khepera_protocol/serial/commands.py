"""The command table of the Khepera serial protocol, as data.

One row a letter, for the Khepera (ROM 5.x) and the Khepera II alike: both answer all 18.
Titles, fields, ranges and units after the appendix A of the Khepera User Manual 5.02, each
cross-checked against clients of real robots (kMatlab, RoadNarrows pyKhepera, Player, Pyro,
KiKS). Values beyond a range have no documented answer: `Beyond` states the choice made here.
"""

from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Final


class Beyond(Enum):
    """The robot's way with a number outside the range of its field."""

    CLAMP = "take the nearest value of the range and acknowledge"
    REJECT = "answer z,Protocol error"


@dataclass(frozen=True, slots=True)
class Field:
    """A number in a request or reply: its inclusive range and its unit."""

    name: str
    low: int
    high: int
    unit: str = ""
    beyond: Beyond = Beyond.REJECT


@dataclass(frozen=True, slots=True)
class Command:
    """A row of the table.

    Attributes:
        letter: upper-case letter of the request; the reply begins with it in lower case.
        title: the manual's name for the command.
        request: fields after the letter.
        reply: fields after the letter in the reply.
        open_ended: whether text after the last field is passed on unparsed (turrets only).
        reply_is_text: whether the reply's values are words instead of integers (versions).
        source: who documents the row.
    """

    letter: str
    title: str
    request: tuple[Field, ...] = ()
    reply: tuple[Field, ...] = ()
    open_ended: bool = False
    reply_is_text: bool = False
    source: str = "manual appendix A; kMatlab; RoadNarrows"


COUNTER_LOW: Final = -(2**31)
COUNTER_HIGH: Final = 2**31 - 1
TARGET_LIMIT: Final = 2**23 - 2
"""Greatest target of the position controller, in counts (about 670 m)."""

SENSORS: Final = (
    "left 90",
    "left 45",
    "left 10",
    "right 10",
    "right 45",
    "right 90",
    "back right",
    "back left",
)
"""The eight infrared sensors in reply order: clockwise from the left, seen from above."""

SENSOR_BEARINGS: Final = (90.0, 45.0, 10.0, -10.0, -45.0, -90.0, -170.0, 170.0)
"""Their nominal directions, degrees from straight ahead, left positive; for drawings."""


def _pair(low: int, high: int, unit: str, beyond: Beyond = Beyond.CLAMP) -> tuple[Field, Field]:
    return Field("left", low, high, unit, beyond), Field("right", low, high, unit, beyond)


def _gains() -> tuple[Field, ...]:
    return tuple(Field(name, 0, 32767, "", Beyond.CLAMP) for name in ("Kp", "Ki", "Kd"))


def _sensors() -> tuple[Field, ...]:
    return tuple(Field(name, 0, 1023, "counts") for name in SENSORS)


def _status(side: str) -> tuple[Field, ...]:
    return (
        Field(f"{side} target reached", 0, 1),
        Field(f"{side} mode", 0, 1, "0 position, 1 speed"),
        Field(f"{side} error", COUNTER_LOW, COUNTER_HIGH, "counts or counts/10 ms"),
    )


_ADDRESS = Field("address", 0, 63)
_BYTE = Field("data", 0, 255, beyond=Beyond.CLAMP)
_PROFILE = (
    Field("left speed", 0, 127, "counts/10 ms", Beyond.CLAMP),
    Field("left acceleration", 0, 255, "counts/256/10 ms/10 ms", Beyond.CLAMP),
    Field("right speed", 0, 127, "counts/10 ms", Beyond.CLAMP),
    Field("right acceleration", 0, 255, "counts/256/10 ms/10 ms", Beyond.CLAMP),
)

_TABLE = (
    Command("A", "Configure speed controller", _gains()),
    Command(
        "B",
        "Read software version",
        (),
        (Field("BIOS", 0, 0), Field("protocol", 0, 0)),
        reply_is_text=True,
    ),
    Command("C", "Set position to be reached", _pair(-TARGET_LIMIT, TARGET_LIMIT, "counts")),
    Command("D", "Set speed", _pair(-127, 127, "counts/10 ms")),
    Command("E", "Read speed", (), _pair(-1023, 1023, "counts/10 ms")),
    Command("F", "Configure position controller", _gains()),
    Command("G", "Set position counters", _pair(COUNTER_LOW, COUNTER_HIGH, "counts")),
    Command("H", "Read position counters", (), _pair(COUNTER_LOW, COUNTER_HIGH, "counts")),
    Command(
        "I",
        "Read A/D input",
        (Field("channel", 0, 5),),
        (Field("value", 0, 1023, "4.096 V / 1024"),),
    ),
    Command("J", "Configure speed profile", _PROFILE),
    Command("K", "Read motion controller status", (), _status("left") + _status("right")),
    Command(
        "L",
        "Change LED state",
        (Field("LED", 0, 1, "0 lateral, 1 frontal"), Field("action", 0, 2, "off, on, toggle")),
    ),
    Command("N", "Read proximity sensors", (), _sensors()),
    Command("O", "Read ambient light sensors", (), _sensors()),
    Command("P", "Set PWM", _pair(-255, 255, "1/255 of the supply voltage")),
    Command("R", "Read byte on extension bus", (_ADDRESS,), (_BYTE,)),
    Command(
        "T",
        "Turret message",
        (Field("turret", 0, 255),),
        (Field("turret", 0, 255),),
        open_ended=True,
    ),
    Command("W", "Write byte on extension bus", (_BYTE, _ADDRESS)),
)

COMMANDS: Final = MappingProxyType({command.letter: command for command in _TABLE})
"""The table by letter. M, Q, S, U, V, X, Y and Z are not assigned on a Khepera."""

TOOLS: Final = MappingProxyType(
    {
        "flash": "erase (E) or write (W) the flash memory",
        "help": "list the tools",
        "k-team": "list the people behind the robot",
        "list": "list the modules in ROM",
        "memory": "show the use of memory",
        "net": "list the turrets on the extension bus",
        "process": "list the processes",
        "restart": "start again, as after power-on",
        "run": "start a module in ROM",
        "serial": "show or set the rate of the serial line",
        "sfill": "load S-records to be written to the flash memory",
        "var": "list the variables",
        "ver": "show the versions",
    }
)
"""Lower-case words that run a tool of the ROM; arguments are separated by blanks."""

FLASH_TOOLS: Final = frozenset({"flash", "sfill"})
"""Tools of a robot with a flash memory for user programs, the Khepera II (NRS)."""
