"""The messages of the turrets that T passes on, as data: one table for both ends.

A turret that is addressed by its number answers `T,<id>,<letter>[,arguments]` with
`t,<id>,<letter in lower case>[,values]`. The general I/O turret has no number: it sits on the
byte bus (R, W) and on the A/D inputs (I).
Sources: kMatlab, KiKS, and the C++ class KheperaInterface, which compares replies byte by byte.
Laser GPS (3), CMUcam (10) and K6300 (25) are known to exist; their messages are not documented.
"""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from khepera_protocol.serial.commands import Field
from khepera_protocol.serial.errors import ReplyError, RequestError
from khepera_protocol.serial.messages import (
    PROTOCOL_ERROR,
    TURRET_NOT_SUPPORTED,
    Reply,
    Request,
    build_request,
    is_integer,
    parse_number,
)

PIXELS: Final = 64
"""Pixels of the linear vision turret, from left to right."""

READING_PERIODS: Final = (0.200, 0.050, 0.100, 0.150, 0.250, 0.500, 1.000, 5.000)
"""Seconds between two images of the linear vision turret, by the code of its message U (KiKS)."""

RADIO_BYTES: Final = 16
"""Most bytes of one radio message; shorter ones are padded with zeros."""

RADIO_READY, RADIO_RECEIVED, RADIO_FAILED = 1, 2, 4
"""Bits of the radio's status: ready to send, message received, last message not delivered."""

BUS_ADDRESS: Final = 32
"""Addresses of the general I/O turret's digital inputs (R) and outputs (W) on the extension bus."""

ANALOGUE_CHANNELS: Final = (3, 4, 5)
"""A/D channels (I) of the general I/O turret's analogue inputs."""


@dataclass(frozen=True, slots=True)
class TurretMessage:
    """A message that a turret understands.

    Attributes:
        letter: upper-case letter of the message; the reply has it in lower case.
        title: what it is for.
        request: fields after the letter.
        reply: fields after the letter in the reply.
    """

    letter: str
    title: str
    request: tuple[Field, ...] = ()
    reply: tuple[Field, ...] = ()


@dataclass(frozen=True, slots=True)
class TurretKind:
    """A turret with its messages.

    Attributes:
        name: what it is called on command lines.
        title: its name and maker's words.
        number: the one that T addresses it by; None for a turret on the byte bus.
        messages: by their letters.
    """

    name: str
    title: str
    number: int | None
    messages: MappingProxyType[str, TurretMessage]
    source: str


def turret_kind(
    name: str, title: str, number: int | None, source: str, *messages: TurretMessage
) -> TurretKind:
    """Make a kind of turret from its messages; see `TurretKind` for the arguments."""
    by_letter = MappingProxyType({message.letter: message for message in messages})
    return TurretKind(name, title, number, by_letter, source)


def _byte(name: str, unit: str = "") -> Field:
    return Field(name, 0, 255, unit)


def _bytes(name: str, count: int) -> tuple[Field, ...]:
    return tuple(_byte(f"{name} {number}") for number in range(1, count + 1))


def _starts(count: int) -> Field:
    # 0 is taken in by the table because the base of the numbers is not settled: the turret's affair
    return Field("first pixel", 0, PIXELS + 1 - count)


_VERSION = TurretMessage("B", "Read software version", (), (_byte("version"), _byte("revision")))
_PIXEL = Field("pixel", 0, PIXELS)

_GRIPPER = turret_kind(
    "gripper",
    "Gripper: an arm with two fingers",
    1,
    "KheperaInterface, k2py, kMatlab, Pyro",
    _VERSION,
    TurretMessage("D", "Open or close the fingers", (Field("state", 0, 1, "0 open, 1 close"),)),
    TurretMessage("E", "Move the arm", (_byte("position", "255 down in front"),)),
    TurretMessage("F", "Read resistivity", (), (_byte("resistivity", "0 no contact"),)),
    TurretMessage("G", "Read optical barrier", (), (_byte("barrier", "0 nothing in the beam"),)),
    TurretMessage(
        "H",
        "Read position",
        (Field("joint", 0, 1, "0 fingers, 1 arm"),),
        (_byte("position", "fingers: 0 closed, 255 open"),),
    ),
    TurretMessage("J", "Read jumpers", (), (_byte("jumpers"),)),
)

_K213 = turret_kind(
    "k213",
    "K213 linear vision: 64 grey pixels over 36 degrees",
    2,
    "KheperaInterface, KiKS; N and L also kMatlab",
    _VERSION,
    TurretMessage("L", "Read light intensity", (), (_byte("high byte"), _byte("low byte"))),
    TurretMessage("M", "Read image, 16 grey levels, two a byte", (), _bytes("pixels", 32)),
    TurretMessage("N", "Read image", (), _bytes("pixel", PIXELS)),
    TurretMessage("O", "Find the brightest pixel", (), (_PIXEL,)),
    TurretMessage("P", "Find the darkest pixel", (), (_PIXEL,)),
    TurretMessage("Q", "Read 8 pixels", (_starts(8),), _bytes("pixel", 8)),
    TurretMessage("R", "Read 16 pixels", (_starts(16),), _bytes("pixel", 16)),
    TurretMessage("S", "Read every second pixel", (), _bytes("pixel", 32)),
    TurretMessage("T", "Read every fourth pixel", (), _bytes("pixel", 16)),
    TurretMessage("U", "Set reading period", (Field("code", 0, len(READING_PERIODS) - 1),)),
)

_RADIO = turret_kind(
    "radio",
    "Radio: 16 bytes from robot to robot",
    4,
    "KiKS, kMatlab",
    _VERSION,
    TurretMessage("F", "Read status", (), (Field("status", 0, 7, "bits"),)),
    TurretMessage(
        "R",
        "Read the receive buffer",
        (),
        (_byte("sender"), Field("length", 0, RADIO_BYTES), *_bytes("data", RADIO_BYTES)),
    ),
    TurretMessage(
        "S",
        "Send",
        (_byte("receiver"), Field("length", 1, RADIO_BYTES), *_bytes("data", RADIO_BYTES)),
    ),
)

_GENERAL_IO = turret_kind(
    "general-io",
    "General I/O: a byte in, a byte out, three analogue inputs",
    None,
    "RoadNarrows",
)

TURRETS: Final = MappingProxyType(
    {kind.name: kind for kind in (_GRIPPER, _K213, _RADIO, _GENERAL_IO)}
)
"""The turrets by name."""


def build_message(name: str, letter: str, *arguments: int) -> Request:
    """Return the request that carries a message to a turret.

    Raises:
        RequestError: no such turret with messages, no such message, or arguments that it does
            not take.
    """
    kind = TURRETS.get(name)
    if kind is None or kind.number is None:
        raise RequestError(TURRET_NOT_SUPPORTED, f"{name!r} is no turret that takes messages")
    rest = (letter, *map(str, arguments))
    parse_message(kind, rest, ignore_extra=False)
    return build_request("T", kind.number, rest=rest)


def parse_message(
    kind: TurretKind, rest: tuple[str, ...], *, ignore_extra: bool = True
) -> tuple[TurretMessage, tuple[int, ...]]:
    """Read what follows the number in a T request.

    Args:
        kind: the turret that it goes to.
        rest: letter and arguments.
        ignore_extra: take no notice of arguments to a message that has none.

    Raises:
        RequestError: with the robot's answer in `reply`.
    """
    letter = rest[0].rstrip(" ") if rest else ""
    message = kind.messages.get(letter)
    if message is None:
        raise RequestError(TURRET_NOT_SUPPORTED, f"{kind.name} has no message {letter!r}")
    arguments = rest[1:]
    if ignore_extra and not message.request:
        return message, ()
    if len(arguments) != len(message.request):
        raise RequestError(PROTOCOL_ERROR, f"{letter} takes {len(message.request)} argument(s)")
    # a turret clamps nothing: an argument that it cannot take is refused
    pairs = zip(message.request, arguments, strict=True)
    return message, tuple(parse_number(field, argument) for field, argument in pairs)


def message_values(request: Request, reply: Reply) -> tuple[int, ...]:
    """Return the values in the reply to a turret's message, as `parse_reply` has read it.

    Raises:
        ReplyError: another letter, a wrong number of values, or no integers.
    """

    def error(reason: str) -> ReplyError:
        return ReplyError(request.encode(), reply.encode().rstrip(b"\r\n"), reason)

    kinds = [kind for kind in TURRETS.values() if request.arguments == (kind.number,)]
    message = kinds[0].messages.get(request.rest[0]) if kinds and request.rest else None
    if message is None:
        raise error("a message that is not in the table of turrets")
    if not reply.text or reply.text[0] != message.letter.lower():
        raise error("a reply to another message")
    words = reply.text[1:]
    if len(words) != len(message.reply):
        raise error(f"{len(message.reply)} value(s) expected, got {len(words)}")
    if not all(map(is_integer, words)):
        raise error("integers expected")
    return tuple(map(int, words))
