"""Mistakes in a data file: all of them at once, in the words of whoever wrote the file.

pydantic finds them and tells where they are; its sentences speak of inputs and models, though,
and readers of an arena know tables, keys and numbers.
"""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any, Final, get_args

from khepera_protocol.text import printable
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

_MOST_TOLD: Final = 10
"""Mistakes that are told one by one."""

_LONGEST: Final = 60
"""Characters of a value or a key that are shown."""

_ALIKE: Final = 0.7
"""Least similarity of a misspelt key and the one that is meant; see `difflib`."""

_SENTENCES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "finite_number": "{value} is not a finite number",
        "float_type": "{value} is not a number",
        "greater_than": "{value} is not more than {gt:g}",
        "greater_than_equal": "{value} is less than {ge:g}",
        "int_type": "{value} is not a whole number",
        "less_than_equal": "{value} is more than {le:g}",
        "list_type": "{value} is not a list",
        "literal_error": "{value} is not one of {expected}",
        "model_type": "{value} is not a table",
        "string_too_long": "it has more than {max_length} characters",
        "string_type": "{value} is not a text in quotes",
        "too_long": "there are more than {max_length}",
        "too_short": "there are {actual_length}, and {min_length} at least are needed",
        "tuple_type": "{value} is not a list",
        "value_error": "{error}",
    }
)


def describe(error: ValidationError, model: type[BaseModel]) -> str:
    """Tell what is wrong with a document, in one sentence.

    Args:
        error: what pydantic has found.
        model: of the whole document.
    """
    told = list(_mistakes(error.errors(include_url=False), model))
    more = len(told) - _MOST_TOLD
    count = f"{len(told)} mistakes: " if len(told) > 1 else ""
    return count + "; ".join(told[:_MOST_TOLD]) + (f"; and {more} more" if more > 0 else "")


def _mistakes(errors: list[ErrorDetails], model: type[BaseModel]) -> Iterator[str]:
    missing = {each["loc"] for each in errors if each["type"] == "missing"}
    meant = {}
    for each in errors:
        if each["type"] == "extra_forbidden":
            *table, key = each["loc"]
            keys = _keys(model, table)
            # a key that is missing is meant more likely than one that is there
            absent = [name for name in keys if (*table, name) in missing]
            close = _closest(str(key), absent) or _closest(str(key), keys)
            hint = f"did you mean {close[0]!r}?" if close else f"there are {', '.join(keys)}"
            meant[each["loc"]] = hint
            missing -= {(*table, name) for name in close}
    for each in errors:
        loc = each["loc"]
        if each["type"] == "missing" and loc not in missing:
            continue  # it is there, misspelt
        if loc in meant:
            yield f"{_place(loc[:-1])}there is no key {_shown(loc[-1])}; {meant[loc]}"
        elif each["type"] == "missing" and isinstance(loc[-1], str):
            yield f"{_place(loc[:-1])}the key {loc[-1]!r} is missing"
        else:
            yield _place(loc) + _sentence(each)


def _closest(word: str, words: list[str]) -> list[str]:
    """Return the one that is probably meant, if there is one."""
    return get_close_matches(word, words, 1, _ALIKE)


def _sentence(error: ErrorDetails) -> str:
    if error["type"] == "missing":
        return "it is missing"
    if error["type"] == "list_type" and isinstance(error["input"], dict):
        return "it is a single table; write its name in double brackets, one for each"
    sentence = _SENTENCES.get(error["type"])
    if sentence is None:
        return printable(error["msg"])
    return sentence.format(value=_shown(error["input"]), **error.get("ctx", {}))


def _place(loc: tuple[int | str, ...]) -> str:
    """Name a place: tables and lists are counted from 1, as a reader counts them."""
    words: list[str] = []
    for part in loc:
        if isinstance(part, int):
            numbered = not words or words[-1][-1:].isdigit()
            words.append(f"number {part + 1}" if numbered else f"{words.pop()} {part + 1}")
        else:
            words.append(printable(part, _LONGEST))
    return ", ".join(words) + ": " if words else ""


def _shown(value: object) -> str:
    return printable(repr(value), _LONGEST)


def _keys(model: type[BaseModel], table: list[int | str]) -> list[str]:
    """Return the keys that a table of a document may have."""
    kind: Any = model
    for part in table:
        kind = get_args(kind)[0] if isinstance(part, int) else kind.model_fields[part].annotation
    return list(kind.model_fields)
