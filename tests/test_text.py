"""Text from outside: safe for a terminal, and parsed within bounds."""

import contextlib
import logging

import pytest
from hypothesis import given
from hypothesis import strategies as st
from khepera_protocol.text import (
    MAX_DOCUMENT,
    DocumentError,
    PrintableFormatter,
    in_order,
    parse_toml,
    printable,
)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Corridor, 25 cm", "Corridor, 25 cm"),
        ("Zürich", "Zürich"),
        ("\x1b[2J", "\\x1b[2J"),
        (b"n,1\r\n", "n,1\\r\\n"),
        (b"\x9b2J", "\\x9b2J"),
        ("a\u202eb", "a\\u202eb"),
        ("\udcff", "\\udcff"),
    ],
)
def test_what_a_terminal_would_obey_is_shown_as_an_escape(text: str | bytes, shown: str) -> None:
    assert printable(text) == shown


def test_long_text_is_cut() -> None:
    assert printable("x" * 100, 10) == "x" * 10 + "…"


@given(st.one_of(st.text(), st.binary()))
def test_whatever_comes_is_printable(text: str | bytes) -> None:
    assert printable(text).isprintable()


def test_toml_is_parsed() -> None:
    assert parse_toml(b'a = 1\n[b]\nc = "d"\n') == {"a": 1, "b": {"c": "d"}}


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"a = ", "Invalid value"),
        (b"a = " + b"[" * 100_000, "nested too deeply"),
        (b"a = " + b"9" * 5000, "a number is too long"),
        (b"\xff", "byte 0 is not UTF-8"),
        (b"#" * (MAX_DOCUMENT + 1), "1,000,001 bytes"),
        (b"\x1b = 1", "Invalid"),
    ],
)
def test_toml_that_cannot_be_parsed_says_why(data: bytes, reason: str) -> None:
    with pytest.raises(DocumentError, match=reason) as caught:
        parse_toml(data)
    assert str(caught.value).isprintable()


@given(st.binary(max_size=200))
def test_damaged_toml_raises_nothing_else(data: bytes) -> None:
    with contextlib.suppress(DocumentError):
        parse_toml(data)


def test_logs_show_what_a_terminal_would_obey() -> None:
    formatter = PrintableFormatter("%(levelname)s: %(message)s")
    try:
        raise ValueError("\x1b[31m\rred")
    except ValueError as error:
        record = logging.LogRecord("x", logging.ERROR, "", 0, "a\nb %s", ("\x1b]0;t\x07",), None)
        record.exc_info = (type(error), error, error.__traceback__)
    first, *trace = formatter.format(record).split("\n")
    assert first == r"ERROR: a\nb \x1b]0;t\x07"
    assert trace[-1] == r"ValueError: \x1b[31m\rred"
    assert all(line.isprintable() for line in trace)


def test_names_are_sorted_by_their_numbers() -> None:
    names = ["khepera-1", "khepera-2", "khepera-10", "khepera-12", "left", "left-3"]
    assert sorted(set(names), key=in_order) == names
    assert in_order("9" * 10_000)  # whatever a stranger calls a robot
