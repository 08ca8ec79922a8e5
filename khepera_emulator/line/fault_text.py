"""Faults as they are written: `KIND:KEY=VALUE,...`, and schedules of them; see `fault`."""

from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Final

from khepera_protocol.text import printable

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.clock import on_grid
from khepera_emulator.line.fault import (
    ANGLE,
    BOTH,
    DELAY,
    STRAY,
    Direction,
    Fault,
    Kind,
    Victim,
    find_kind,
    split_kind,
)

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
_LASTS: Final = 1.0
"""Seconds of a stall or a cut, and of what befalls the robot by chance."""

_SENSORS: Final = 8
_WHEELS: Final = ("left", "right", "both")
_MOST_ANGLE: Final = 180.0


def parse_fault(text: str) -> Fault:
    r"""Read `KIND:KEY=VALUE,...`.

    Raises:
        EmulatorError: it is no fault; the message says why.
    """
    if len(text) > _LONGEST:
        raise _wrong(text, f"it has {len(text):,} characters, and {_LONGEST:,} at most are read")
    name, rest = split_kind(text)
    try:
        kind: Kind = find_kind(name)
    except EmulatorError as error:
        raise _wrong(text, str(error)) from None
    values = _values(text, rest)
    for key in values:
        if key not in kind.keys:
            raise _wrong(text, f"{name} knows {', '.join(kind.keys)}, not '{_shown(key)}'")
    if kind.once and not {"p", "at"} & set(values):
        raise _wrong(text, f"{name} needs p (a chance) or at (a time)")
    return _fault(text, name, kind, values)


def _fault(text: str, name: str, kind: Kind, values: Mapping[str, str]) -> Fault:
    def seconds(key: str, default: float) -> float:
        return _seconds(text, key, values[key]) if key in values else default

    on_robot = kind.victim is Victim.ROBOT
    timed = (kind.once or on_robot) and "p" not in values
    return Fault(
        name,
        chance=None if timed else _number(text, "p", values.get("p", "1"), 1.0),
        directions=_directions(text, kind, values.get("dir", "both")),
        at=seconds("at", 0.0),
        lasts=seconds("for", _usual_length(kind, timed)),
        time=seconds("time", DELAY),
        text=_unescape(text, values["text"]) if "text" in values else STRAY,
        most=_number(text, "n", values["n"], _MOST_TIMES) if "n" in values else inf,
        sensor=_sensor(text, values["sensor"]) if "sensor" in values else None,
        wheel=_wheel(text, values.get("wheel", "both")),
        part=_number(text, "part", values["part"], 1.0) if "part" in values else None,
        angle=_angle(text, values["angle"]) if "angle" in values else ANGLE,
    )


def _usual_length(kind: Kind, timed: bool) -> float:
    """Return seconds that a fault lasts when nobody says how long."""
    own: float | None = getattr(kind, "lasts", None)
    if own is not None:
        return own
    by_request = kind.victim is Victim.REQUEST and "for" in kind.keys
    by_chance = kind.victim is Victim.ROBOT and not timed
    return _LASTS if by_request or by_chance else inf


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
    """Return the faults of a schedule, each as `parse_fault` reads it; see `parse_script`."""
    if len(text) > MAX_SCRIPT:
        raise EmulatorError(f"the fault script has more than {MAX_SCRIPT:,} characters")
    specs: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        line = line.strip()
        if not line or line.startswith("#"):
            continue
        time, _, spec = line.partition(" ")
        kind, rest = split_kind(spec.strip())
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


def read_script(script: Path) -> list[str]:
    """Read a schedule from a file; see `script_specs`.

    Raises:
        EmulatorError: it cannot be read, or is none.
    """
    name = printable(str(script), 300)
    try:
        with script.open("rb") as file:
            text = file.read(MAX_SCRIPT + 1).decode()
    except OSError as error:
        raise EmulatorError(f"cannot read the fault script {name}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise EmulatorError(
            f"cannot read the fault script {name}: byte {error.start} is not UTF-8 text"
        ) from None
    return script_specs(text)


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


def _directions(text: str, kind: Kind, word: str) -> tuple[Direction, ...]:
    if kind.victim is Victim.REPLY:
        return (Direction.REPLY,)
    if word == "both":
        return BOTH
    if word not in tuple(Direction):
        raise _wrong(text, f"dir is request, reply or both, not '{_shown(word)}'")
    return (Direction(word),)


def _sensor(text: str, word: str) -> int:
    if word not in map(str, range(_SENSORS)):
        raise _wrong(text, f"sensor={_shown(word)} is none: give 0 to {_SENSORS - 1}")
    return int(word)


def _wheel(text: str, word: str) -> str:
    if word not in _WHEELS:
        raise _wrong(text, f"wheel is left, right or both, not '{_shown(word)}'")
    return word


def _angle(text: str, word: str) -> float:
    sign = -1.0 if word.startswith("-") else 1.0
    return sign * _number(text, "angle", word.removeprefix("-"), _MOST_ANGLE)


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
