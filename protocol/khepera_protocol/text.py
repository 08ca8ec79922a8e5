"""Text from outside: made safe for a terminal, and read within bounds.

Bytes of a serial line, names in a file and messages of a peer may hold escape sequences that move
the cursor or change colours; documents may take all memory. Nothing is read from a file here.
"""

import logging
import re
import tomllib
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any, Final

MAX_DOCUMENT: Final = 1_000_000
"""Bytes of the longest TOML document that is parsed."""

_DIGITS: Final = 20
"""Digits of a number in a name that is sorted by its value."""


class DocumentError(ValueError):
    """A document cannot be parsed; the message says why, without naming the document."""


class OptionError(ValueError):
    """Options, or a file of them, that cannot be used; the message is one sentence."""


def printable(text: str | bytes, limit: int | None = None) -> str:
    r"""Replace what a terminal would obey by escapes such as `\x1b`, and cut what is too long.

    Args:
        text: foreign text; bytes stand for the characters U+0000 to U+00FF.
        limit: greatest number of characters; None: as many as there are.
    """
    if isinstance(text, bytes):
        text = text.decode("latin-1")
    if limit is not None and len(text) > limit:
        text = text[:limit] + "…"
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in text
    )


def quoted(text: str, limit: int = 60) -> str:
    """Return foreign text for an error message: in quotes, safe for a terminal and cut."""
    return f"'{printable(text, limit)}'"


def in_order(name: str) -> str:
    """Return a key that sorts names as people do: robot-2 before robot-10."""
    return re.sub(r"\d+", lambda number: number[0].zfill(_DIGITS), name)


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Return a hint for an error message, with a space behind it; empty where no name is close."""
    close = get_close_matches(word, list(names), 1)
    return f"did you mean {close[0]}? " if close else ""


def parse_toml(data: bytes) -> dict[str, Any]:
    """Parse a TOML document of bounded size.

    Raises:
        DocumentError: it is too long, nested too deeply, not UTF-8, or not TOML.
    """
    if len(data) > MAX_DOCUMENT:
        raise DocumentError(f"it has {len(data):,} bytes, {MAX_DOCUMENT:,} at most are read")
    try:
        return tomllib.loads(data.decode())
    except UnicodeDecodeError as error:
        raise DocumentError(f"byte {error.start} is not UTF-8 text") from None
    except RecursionError:
        raise DocumentError("it is nested too deeply") from None
    except ValueError as error:
        # a number with more digits than Python converts is a plain ValueError with a long story
        what = str(error) if isinstance(error, tomllib.TOMLDecodeError) else "a number is too long"
        raise DocumentError(printable(what, 300)) from None


class PrintableFormatter(logging.Formatter):
    """Formats log records so that a terminal obeys nothing in them; a message is one line."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - the base's name
        """Format a record but for the traceback."""
        return printable(super().formatMessage(record))

    def formatException(self, ei: Any) -> str:  # noqa: N802 - the base's name
        """Format a traceback, which has lines."""
        return "\n".join(map(printable, super().formatException(ei).split("\n")))
