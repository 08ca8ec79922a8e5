"""The table of the turrets' messages, read from both ends."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies._internal.core import DataObject
from khepera_protocol.serial.errors import ReplyError, RequestError
from khepera_protocol.serial.messages import Reply, build_request, parse_reply, parse_request
from khepera_protocol.serial.turrets import (
    TURRETS,
    TurretKind,
    TurretMessage,
    build_message,
    message_values,
    parse_message,
)

LETTERS = {"gripper": "BDEFGHJ", "k213": "BLMNOPQRSTU", "radio": "BFRS", "general-io": ""}
NUMBERS = {"gripper": 1, "k213": 2, "radio": 4, "general-io": None}
REPLY_FIELDS = {
    "k213": {"B": 2, "L": 2, "M": 32, "N": 64, "O": 1, "P": 1, "Q": 8, "R": 16, "S": 32, "T": 16},
    "gripper": {"B": 2, "F": 1, "G": 1, "H": 1, "J": 1},
    "radio": {"B": 2, "F": 1, "R": 18},
}


def test_the_table_is_that_of_the_specification() -> None:
    assert {name: "".join(kind.messages) for name, kind in TURRETS.items()} == LETTERS
    assert {name: kind.number for name, kind in TURRETS.items()} == NUMBERS
    for name, counts in REPLY_FIELDS.items():
        messages = TURRETS[name].messages
        assert {m.letter: len(m.reply) for m in messages.values() if m.reply} == counts


@st.composite
def messages(draw: st.DrawFn) -> tuple[TurretKind, TurretMessage, list[Any]]:
    kind = TURRETS[draw(st.sampled_from(["gripper", "k213", "radio"]))]
    message = kind.messages[draw(st.sampled_from(sorted(kind.messages)))]
    numbers = [draw(st.integers(field.low, field.high)) for field in message.request]
    return kind, message, numbers


@given(messages(), st.data())
def test_messages_and_replies_survive_the_line(
    drawn: tuple[TurretKind, TurretMessage, list[Any]], data: DataObject
) -> None:
    kind, message, numbers = drawn
    request = build_message(kind.name, message.letter, *numbers)
    assert parse_request(request.encode().rstrip(b"\n")) == request
    assert parse_message(kind, request.rest) == (message, tuple(numbers))
    values = tuple(data.draw(st.integers(field.low, field.high)) for field in message.reply)
    sent = Reply("t", request.arguments, (message.letter.lower(), *map(str, values))).encode()
    assert message_values(request, parse_reply(request, sent.rstrip(b"\r\n"))) == values


@pytest.mark.parametrize(
    ("name", "rest", "answer"),
    [
        ("gripper", ("A",), "z,Turret order not supported"),
        ("gripper", ("b",), "z,Turret order not supported"),
        ("gripper", ("",), "z,Turret order not supported"),
        ("gripper", (), "z,Turret order not supported"),
        ("gripper", ("D",), "z,Protocol error"),
        ("gripper", ("D", "2"), "z,Protocol error"),
        ("gripper", ("D", "1", "1"), "z,Protocol error"),
        ("gripper", ("E", "256"), "z,Protocol error"),
        ("gripper", ("E", "x"), "z,Protocol error"),
        ("k213", ("U", "8"), "z,Protocol error"),
        ("radio", ("S", "1", "1", "0"), "z,Protocol error"),
    ],
)
def test_refused_message(name: str, rest: tuple[str, ...], answer: str) -> None:
    with pytest.raises(RequestError) as caught:
        parse_message(TURRETS[name], rest)
    assert caught.value.reply == answer


def test_what_follows_a_message_without_arguments() -> None:
    kind = TURRETS["gripper"]
    assert parse_message(kind, ("F ", "1"))[1] == ()
    with pytest.raises(RequestError):
        parse_message(kind, ("F", "1"), ignore_extra=False)


@pytest.mark.parametrize("name", ["general-io", "laser"])
def test_no_message_goes_to_a_turret_without_a_number(name: str) -> None:
    with pytest.raises(RequestError, match="takes messages"):
        build_message(name, "B")


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (b"t,1,g,1", "another message"),
        (b"t,1", "another message"),
        (b"t,1,f", "1 value"),
        (b"t,1,f,1,2", "1 value"),
        (b"t,1,f,x", "integers"),
    ],
)
def test_wrong_reply(line: bytes, reason: str) -> None:
    request = build_message("gripper", "F")
    with pytest.raises(ReplyError, match=reason) as caught:
        message_values(request, parse_reply(request, line))
    assert caught.value.received == line


def test_a_reply_to_an_unknown_message_has_no_values() -> None:
    request = build_request("T", 25, rest=("X",))
    with pytest.raises(ReplyError, match="not in the table"):
        message_values(request, parse_reply(request, b"t,25,x"))
