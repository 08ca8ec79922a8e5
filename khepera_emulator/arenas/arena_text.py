"""An arena as the text of a TOML file, in the style of those that come with the package."""

import json
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

from pydantic import BaseModel

from khepera_emulator.arenas.arena import Arena

_WIDTH: Final = 96
"""Characters from which on a list of points goes on several lines."""

_TOLD: Final = frozenset({"floor", "sky", "heading", "colour", "heading_spread", "gap"})
"""Fields that are written even where they are as if absent."""

Notes = Mapping[tuple[str, int], str]
"""Comments on parts, by the name of their table and their number in it."""

_NONE: Final[Notes] = MappingProxyType({})


def arena_text(arena: Arena, head: Sequence[str] = (), notes: Notes = _NONE) -> str:
    """Write an arena down; reading the text gives the same arena.

    Args:
        arena: which.
        head: lines of comment at the top.
        notes: comments on its parts.
    """
    single: list[str] = []
    tables: list[list[str]] = []
    for name in Arena.model_fields:
        value = getattr(arena, name)
        if isinstance(value, BaseModel):
            tables.append([f"[{name}]", *_fields(value)])
        elif isinstance(value, list):
            for number, part in enumerate(value):
                note = notes.get((name, number))
                tables.append(
                    [*([f"# {note}"] if note else []), f"[[{name}]]", *_fields(part)],
                )
        else:
            single.append(f"{name} = {_value(value)}")
    blocks = [[*(f"# {line}".rstrip() for line in head), *single], *tables]
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def _fields(part: BaseModel) -> list[str]:
    lines = []
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        if value is not None and (name in _TOLD or value != field.default):
            lines.append(_field(name, value))
    return lines


def _field(name: str, value: Any) -> str:
    line = f"{name} = {_value(value)}"
    if name != "points" or len(line) <= _WIDTH:
        return line
    rows = [""]
    for point in value:
        word = f"{_value(point)},"
        if rows[-1] and len(rows[-1]) + len(word) > _WIDTH - 5:
            rows.append("")
        rows[-1] += f" {word}" if rows[-1] else word
    return "\n".join([f"{name} = [", *(f"    {row}" for row in rows), "]"])


def _value(value: Any) -> str:
    match value:
        case str():
            # TOML's strings are JSON's, but for this character
            return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
        case float():
            return repr(value)
        case tuple() | list():
            return f"[{', '.join(map(_value, value))}]"
        case _:
            return str(value)
