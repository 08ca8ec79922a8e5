"""Switches of a robot's firmware, as text: `NAME` or `NAME=VALUE`, a field of a dataclass each."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

from khepera_protocol.text import quoted

from khepera_emulator.errors import EmulatorError

Form = tuple[re.Pattern[str], str]
"""The texts that a switch takes, and the sentence for others."""

_Switches = TypeVar("_Switches", bound=Any)


def switch_names(switches: Any) -> list[str]:
    """List the names of the switches of a dataclass, as users write them."""
    return [field.name.replace("_", "-") for field in fields(switches)]


def switch_of(item: str) -> str:
    """Return the name in an item."""
    return item.partition("=")[0]


def parse_switches(
    default: _Switches, items: Iterable[str], forms: Mapping[str, Form]
) -> _Switches:
    """Read items such as `reject-beyond` or `rom-revision=4.10`; later ones win.

    Args:
        default: a value of the dataclass: what holds without an item. A field that is False is a
            switch without a value.
        items: what was written.
        forms: of the other fields, by the field's name.

    Raises:
        EmulatorError: an unknown name, or a value that it does not take.
    """
    values: dict[str, Any] = {}
    for item in items:
        name, equals, text = item.partition("=")
        names = switch_names(default)
        if name not in names:
            raise EmulatorError(
                f"unknown firmware option {quoted(name)}; there are {', '.join(names)}"
            )
        attribute = name.replace("-", "_")
        usual = getattr(default, attribute)
        if usual is False:
            if equals:
                raise EmulatorError(f"firmware option {quoted(item)}: a switch takes no value")
            values[attribute] = True
            continue
        pattern, says = forms[attribute]
        if not pattern.fullmatch(text):
            raise EmulatorError(f"firmware option {name}={quoted(text)}: {says}")
        values[attribute] = int(text) if isinstance(usual, int) else text
    return replace(default, **values)
