"""Checks for parts of one's own: run them in a test beside the part.

    from khepera_emulator.checks import check_turret
    from my_package import Mine

    def test_mine() -> None:
        check_turret(Mine)

The turret is mounted on an emulated robot and talked to over its serial line. `CheckError`, an
AssertionError, says what is wrong, at the first thing that a client would stumble over.
"""

import re
from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import Any, Final

from khepera_protocol.serial.commands import Field
from khepera_protocol.serial.turrets import TURRETS, TurretKind, TurretMessage
from khepera_protocol.zenoh.payloads import Reset

from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.robot.emulator import Emulator, Setup
from khepera_emulator.turrets.turret import BusTurret, MessageTurret

_SEED: Final = 3
_PAUSE: Final = 0.25
"""Seconds between two messages: the robot drives meanwhile."""

_PIECES: Final = 25
_NAME: Final = re.compile(r"[a-z0-9][a-z0-9-]{0,31}")
_LETTER: Final = re.compile(r"[A-Z]")
_NUMBERS: Final = range(256)
_ADDRESSES: Final = range(64)
_CHANNELS: Final = range(6)
_COUNTS: Final = range(1024)
_REFUSED: Final = b"z,Protocol error\r\n"


class CheckError(AssertionError):
    """A part does not do what is asked of its kind."""


def check_turret(turret: Any) -> None:
    """Check a class of turrets."""
    kind = getattr(turret, "kind", None)
    if not isinstance(kind, TurretKind):
        raise CheckError("its attribute `kind` is not a TurretKind")
    _check_kind(kind)
    with closing(_robot(turret)) as robot:
        (made,) = robot.robot.turrets.turrets
        if kind.number is None:
            if not isinstance(made, BusTurret):
                raise CheckError("without a number it needs the bus: see BusTurret")
            _check_bus(made)
        else:
            _expect(isinstance(made, MessageTurret), "with a number it needs `answer`")
        first = _conversation(robot, kind)
        for (message, request), reply in zip(_script(kind), first, strict=True):
            _check_reply(kind, message, request, reply)
        robot.reset(Reset(seed=_SEED))
        _same(kind, first, _conversation(robot, kind), "after a seeded reset it answers otherwise")
    with closing(_robot(turret)) as robot:
        said = "where time passes in small steps it answers otherwise"
        _same(kind, first, _conversation(robot, kind, _PIECES), said)


def _check_kind(kind: TurretKind) -> None:
    _expect(
        bool(_NAME.fullmatch(kind.name)),
        f"its name {kind.name!r} is not made of small letters, digits and dashes",
    )
    _expect(
        kind.number is None or kind.number in _NUMBERS,
        f"its number {kind.number} is not 0 to {_NUMBERS[-1]}",
    )
    for known in TURRETS.values():
        _expect(
            kind.number is None or kind.number != known.number or kind.name == known.name,
            f"its number {kind.number} is that of the turret {known.name!r}",
        )
    _expect(
        kind.number is not None or not kind.messages,
        "without a number nobody can send it messages",
    )
    for letter, message in kind.messages.items():
        _expect(
            letter == message.letter and bool(_LETTER.fullmatch(letter)),
            f"the message {letter!r} is not stored by its own capital letter",
        )


def _check_bus(turret: BusTurret) -> None:
    for address in _ADDRESSES:
        byte = turret.read_bus(address)
        _expect(
            byte is None or byte in _NUMBERS, f"at the address {address} it reads {byte}, no byte"
        )
        turret.write_bus(address, 0)
    for channel in _CHANNELS:
        counts = turret.analogue(channel)
        _expect(
            counts is None or counts in _COUNTS,
            f"at the channel {channel} it gives {counts}, not 0 to {_COUNTS[-1]}",
        )


def _check_reply(kind: TurretKind, message: TurretMessage, request: bytes, reply: bytes) -> None:
    if reply == _REFUSED and message.request:
        return
    asked = request.decode()
    head = f"t,{kind.number},{message.letter.lower()}"
    words = reply.decode("latin-1").removesuffix("\r\n").split(",")
    _expect(",".join(words[:3]) == head, f"{asked} is answered {reply!r}, not {head},...")
    values = words[3:]
    _expect(
        len(values) == len(message.reply),
        f"{asked} is answered with {len(values)} values, not {len(message.reply)}",
    )
    for field, word in zip(message.reply, values, strict=True):
        _expect(
            bool(re.fullmatch(r"-?[0-9]+", word)) and field.low <= int(word) <= field.high,
            f"{asked} is answered {word} as {field.name}, not {field.low} to {field.high}",
        )


def _requests(kind: TurretKind) -> Iterator[tuple[TurretMessage, bytes]]:
    """Make every message, with the least, the middle and the greatest arguments."""
    for message in kind.messages.values():
        sets = [[_argument(field, part) for field in message.request] for part in (0, 1, 2)]
        for arguments in sets if message.request else [[]]:
            words = ["T", kind.number, message.letter, *arguments]
            yield message, ",".join(map(str, words)).encode()


def _script(kind: TurretKind) -> list[tuple[TurretMessage, bytes]]:
    """Return all messages of a conversation."""
    return [*_requests(kind)] * 2


def _argument(field: Field, part: int) -> int:
    return field.low + (field.high - field.low) * part // 2


def _robot(turret: Any) -> Emulator:
    return Emulator(Setup(load_arena("open-box"), seed=_SEED, baud=None, turrets=(turret,)))


def _conversation(robot: Emulator, kind: TurretKind, pieces: int = 1) -> list[bytes]:
    """Send every message to a robot that drives, then to one that stands; collect its replies."""
    replies = []
    for speed in (b"D,2,1", b"D,0,0"):
        _ask(robot, speed)
        for _, request in _requests(kind):
            replies.append(_ask(robot, request))
            begin = robot.now
            for piece in range(1, pieces + 1):
                robot.advance(begin + _PAUSE * piece / pieces)
    return replies


def _ask(robot: Emulator, request: bytes) -> bytes:
    robot.write(request + b"\n")
    robot.advance(robot.now)
    return robot.read()


def _same(kind: TurretKind, one: Sequence[bytes], other: Sequence[bytes], what: str) -> None:
    for (_, request), before, after in zip(_script(kind), one, other, strict=True):
        _expect(before == after, f"{what}: {request!r} with {after!r} instead of {before!r}")


def _expect(holds: bool, what: str) -> None:
    if not holds:
        raise CheckError(what)
