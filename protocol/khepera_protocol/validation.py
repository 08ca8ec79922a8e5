"""Faults of values from outside, in one line that a terminal can show."""

from collections.abc import Callable
from typing import Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from khepera_protocol.text import printable

_MOST: Final = 3
"""Faults that are told; with more of them, how many more there are."""


def first_fault(error: ValidationError, whole: str = "") -> str:
    """Return the first thing that is wrong: the place and the reason.

    Args:
        error: of pydantic.
        whole: the place's name where all of it is wrong.
    """
    return _told(_faults(error)[0], whole=whole)


def problems(
    error: ValidationError, name: Callable[[object], str] = str, *, partly: bool = False
) -> str:
    """Return everything that is wrong, at most three things one by one.

    Args:
        error: of a model.
        name: says what a field of the model is called outside.
        partly: fields may be missing; where nothing else is wrong the text is empty.
    """
    faults = [one for one in _faults(error) if not (partly and one["type"] == "missing")]
    said = "; ".join(_told(fault, name) for fault in faults[:_MOST])
    more = len(faults) - _MOST
    return f"{said}; and {more} more" if more > 0 else said


def _faults(error: ValidationError) -> list[ErrorDetails]:
    return error.errors(include_url=False, include_context=False)


def _told(fault: ErrorDetails, name: Callable[[object], str] = str, whole: str = "") -> str:
    place = printable(".".join(map(name, fault["loc"])), 100) or whole
    reason = fault["msg"].removeprefix("Value error, ")
    if reason.startswith("Input "):
        given = fault["input"]
        shown = f", not {printable(repr(given), 40)}" if _is_plain(given) else ""
        reason = f"{reason.removeprefix('Input ')}{shown}"
        return f"{place} {printable(reason, 200)}" if place else printable(reason, 200)
    return f"{place}: {printable(reason, 200)}" if place else printable(reason, 200)


def _is_plain(value: object) -> bool:
    return value is None or isinstance(value, str | int | float | bool)
