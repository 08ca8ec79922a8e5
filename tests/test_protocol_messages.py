"""Requests and replies against the worked examples of the protocol's specification."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies._internal.core import DataObject
from khepera_protocol.serial.commands import COMMANDS, Beyond
from khepera_protocol.serial.errors import ReplyError, RequestError
from khepera_protocol.serial.messages import (
    Reply,
    Request,
    ToolCall,
    _parse_by_table,
    build_request,
    encode_line,
    parse_reply,
    parse_request,
)

EXAMPLES = [
    ("A", (3800, 800, 100), "41 2C 33 38 30 30 2C 38 30 30 2C 31 30 30 0A", (), "61 0D 0A"),
    ("C", (100, 100), "43 2C 31 30 30 2C 31 30 30 0A", (), "63 0D 0A"),
    ("D", (5, -5), "44 2C 35 2C 2D 35 0A", (), "64 0D 0A"),
    ("E", (), "45 0A", (5, -4), "65 2C 35 2C 2D 34 0D 0A"),
    ("F", (3000, 20, 4000), "46 2C 33 30 30 30 2C 32 30 2C 34 30 30 30 0A", (), "66 0D 0A"),
    ("G", (0, 0), "47 2C 30 2C 30 0A", (), "67 0D 0A"),
    ("H", (), "48 0A", (1200, -37), "68 2C 31 32 30 30 2C 2D 33 37 0D 0A"),
    ("I", (3,), "49 2C 33 0A", (512,), "69 2C 35 31 32 0D 0A"),
    ("J", (20, 64, 20, 64), "4A 2C 32 30 2C 36 34 2C 32 30 2C 36 34 0A", (), "6A 0D 0A"),
    ("K", (), "4B 0A", (1, 0, 0, 1, 0, 0), "6B 2C 31 2C 30 2C 30 2C 31 2C 30 2C 30 0D 0A"),
    ("L", (1, 2), "4C 2C 31 2C 32 0A", (), "6C 0D 0A"),
    (
        "N",
        (),
        "4E 0A",
        (0, 12, 340, 300, 7, 0, 0, 3),
        "6E 2C 30 2C 31 32 2C 33 34 30 2C 33 30 30 2C 37 2C 30 2C 30 2C 33 0D 0A",
    ),
    (
        "O",
        (),
        "4F 0A",
        (498, 501, 490, 487, 499, 502, 500, 495),
        "6F 2C 34 39 38 2C 35 30 31 2C 34 39 30 2C 34 38 37 2C 34 39 39 2C 35 30 32 2C 35 30 30"
        " 2C 34 39 35 0D 0A",
    ),
    ("P", (128, -128), "50 2C 31 32 38 2C 2D 31 32 38 0A", (), "70 0D 0A"),
    ("R", (32,), "52 2C 33 32 0A", (255,), "72 2C 32 35 35 0D 0A"),
    ("W", (15, 32), "57 2C 31 35 2C 33 32 0A", (), "77 0D 0A"),
]


@pytest.mark.parametrize(("letter", "arguments", "sent", "values", "received"), EXAMPLES)
def test_worked_example(
    letter: str, arguments: tuple[int, ...], sent: str, values: tuple[int, ...], received: str
) -> None:
    request = build_request(letter, *arguments)
    reply = Reply(letter.lower(), values)
    assert request.encode() == bytes.fromhex(sent)
    assert parse_request(bytes.fromhex(sent)[:-1]) == request
    assert reply.encode() == bytes.fromhex(received)
    assert parse_reply(request, bytes.fromhex(received)[:-2]) == reply


def test_worked_example_of_versions() -> None:
    request = build_request("B")
    reply = Reply("b", text=("5.01", "5.00"))
    assert request.encode() == bytes.fromhex("42 0A")
    assert reply.encode() == bytes.fromhex("62 2C 35 2E 30 31 2C 35 2E 30 30 0D 0A")
    assert parse_reply(request, b"b,5.01,5.00") == reply


def test_worked_example_of_a_turret() -> None:
    request = build_request("T", 1, rest=("B",))
    assert request.encode() == bytes.fromhex("54 2C 31 2C 42 0A")
    assert parse_request(b"T,1,B") == request
    reply = parse_reply(request, b"t,1,b,1,0")
    assert reply == Reply("t", (1,), ("b", "1", "0"))
    assert reply.encode() == bytes.fromhex("74 2C 31 2C 62 2C 31 2C 30 0D 0A")


def test_the_examples_cover_every_command() -> None:
    assert {letter for letter, *_ in EXAMPLES} | {"B", "T"} == set(COMMANDS)
    assert sorted(COMMANDS) == list("ABCDEFGHIJKLNOPRTW")


REFUSALS = [
    (b"M", "Command not found"),
    (b" ", "Command not found"),
    (b"n", "Command not found"),
    (b"", "Command not found"),
    (b"Q,1", "Command not found"),
    (b"HELLO", "Command not found"),
    (b"H H", "Command not found"),
    (b" restart", "Command not found"),
    (b"Restart", "Command not found"),
    (b"\xff\x00", "Command not found"),
    (b"D,5", "z,Protocol error"),
    (b"D", "z,Protocol error"),
    (b"D,5,", "z,Protocol error"),
    (b"D,5,5,5", "z,Protocol error"),
    (b"D,5,x", "z,Protocol error"),
    (b"D,+5,5", "z,Protocol error"),
    (b"D,5.0,5", "z,Protocol error"),
    (b"D,--5,5", "z,Protocol error"),
    (b"D,1 2,5", "z,Protocol error"),
    (b"D,12345678901,5", "z,Protocol error"),
    (b"L,2,0", "z,Protocol error"),
    (b"L,0,3", "z,Protocol error"),
    (b"I,6", "z,Protocol error"),
    (b"I,-1", "z,Protocol error"),
    (b"R,64", "z,Protocol error"),
    (b"W,0,64", "z,Protocol error"),
    (b"T", "z,Protocol error"),
    (b"T,1", "z,Protocol error"),
    (b"T,256,B", "z,Protocol error"),
]


@pytest.mark.parametrize(("line", "answer"), REFUSALS)
def test_refused_request(line: bytes, answer: str) -> None:
    with pytest.raises(RequestError) as caught:
        parse_request(line)
    assert caught.value.reply == answer


@pytest.mark.parametrize(
    ("line", "letter", "arguments"),
    [
        (b"D,200,-200", "D", (127, -127)),
        (b"P,300,-300", "P", (255, -255)),
        (b"C,9999999,-9999999", "C", (8388606, -8388606)),
        (b"J,200,300,-1,-1", "J", (127, 255, 0, 0)),
        (b"A,40000,-3,0", "A", (32767, 0, 0)),
        (b"W,256,1", "W", (255, 1)),
        (b"G,2147483648,0", "G", (2147483647, 0)),
        (b"D, 5 ,-5 ", "D", (5, -5)),
        (b"D,007,-0", "D", (7, 0)),
        (b"N,1", "N", ()),
        (b"H ", "H", ()),
    ],
)
def test_tolerated_request(line: bytes, letter: str, arguments: tuple[int, ...]) -> None:
    assert parse_request(line) == Request(letter, arguments)


def test_clamping_can_be_switched_off() -> None:
    with pytest.raises(RequestError) as caught:
        parse_request(b"D,128,0", reject_beyond=True)
    assert caught.value.reply == "z,Protocol error"
    assert parse_request(b"D,127,0", reject_beyond=True) == Request("D", (127, 0))


def test_tools_take_words_separated_by_blanks() -> None:
    assert parse_request(b"run sloader now") == ToolCall("run", ("sloader", "now"))
    assert parse_request(b"restart") == ToolCall("restart")


@pytest.mark.parametrize(
    ("letter", "arguments"),
    [("M", ()), ("D", (1,)), ("D", (1, 2, 3)), ("D", (128, 0)), ("L", (2, 0)), ("H", (1,))],
)
def test_a_client_cannot_build_a_wrong_request(letter: str, arguments: tuple[int, ...]) -> None:
    with pytest.raises(RequestError):
        build_request(letter, *arguments)


@pytest.mark.parametrize(
    ("letter", "line", "reason"),
    [
        ("D", b"z,Protocol error", "refused"),
        ("D", b"Command not found", "refused"),
        ("D", b"d,1", "0 value"),
        ("D", b"D", "another reply"),
        ("H", b"e,1,2", "another reply"),
        ("H", b"h,1", "2 value"),
        ("H", b"h,1,2,3", "2 value"),
        ("H", b"h,1,", "integers"),
        ("H", b"h,1,0x2", "integers"),
        ("H", b"", "another reply"),
        ("N", b"n,\xe1\xb2,0", "not ASCII"),
        ("B", b"b,5,5", "versions"),
    ],
)
def test_wrong_reply(letter: str, line: bytes, reason: str) -> None:
    with pytest.raises(ReplyError, match=reason) as caught:
        parse_reply(build_request(letter), line) if letter != "D" else parse_reply(
            build_request("D", 1, 1), line
        )
    assert caught.value.received == line
    assert caught.value.request.startswith(letter.encode())


def test_a_reply_of_another_turret_is_refused() -> None:
    with pytest.raises(ReplyError, match="another turret"):
        parse_reply(build_request("T", 1, rest=("B",)), b"t,2,b,1,0")


@st.composite
def requests(draw: st.DrawFn) -> Request:
    command = COMMANDS[draw(st.sampled_from(sorted(COMMANDS)))]
    numbers = tuple(draw(st.integers(field.low, field.high)) for field in command.request)
    rest: tuple[str, ...] = ()
    if command.open_ended:
        word = st.text("ABCDEFGH0123456789", min_size=1, max_size=5)
        rest = tuple(draw(st.lists(word, min_size=1, max_size=4)))
    return Request(command.letter, numbers, rest)


@given(requests())
def test_requests_survive_the_line(request: Request) -> None:
    assert parse_request(request.encode().removesuffix(b"\n")) == request


@given(requests(), st.data())
def test_replies_survive_the_line(request: Request, data: DataObject) -> None:
    command = request.command
    if command.open_ended:
        reply = Reply("t", request.arguments, ("b", "1"))
    elif command.reply_is_text:
        reply = Reply("b", text=("5.02", "5.01"))
    else:
        numbers = [data.draw(st.integers(field.low, field.high)) for field in command.reply]
        reply = Reply(command.letter.lower(), tuple(numbers))
    assert parse_reply(request, reply.encode().removesuffix(b"\r\n")) == reply


@given(requests(), st.binary() | st.text("hnzkb,0123456789-. \r").map(str.encode))
def test_garbage_is_a_reply_or_a_reply_error(request: Request, line: bytes) -> None:
    try:
        reply = parse_reply(request, line)
    except ReplyError:
        return
    assert reply.letter == request.letter.lower()


@given(requests(), st.data())
def test_the_short_way_to_read_a_reply_is_the_table_s(request: Request, data: DataObject) -> None:
    """Good replies, and ones with a character changed."""
    command = request.command
    words = [str(data.draw(st.integers(field.low, field.high))) for field in command.reply]
    good = ",".join([command.letter.lower(), *words])
    place = data.draw(st.integers(0, len(good)))
    bent = good[:place] + data.draw(st.text("0123456789,-+ hnz", max_size=2)) + good[place + 1 :]
    for line in (good.encode(), bent.encode()):
        assert _outcome(parse_reply, request, line) == _outcome(_parse_by_table, request, line)


def _outcome(
    parse: Callable[[Request, bytes], Reply], request: Request, line: bytes
) -> Reply | str:
    try:
        return parse(request, line)
    except ReplyError as error:
        return str(error)


@given(requests().filter(lambda request: request.arguments and request.letter != "T"), st.data())
def test_numbers_out_of_range_are_clamped_or_refused_as_the_table_says(
    request: Request, data: DataObject
) -> None:
    place = data.draw(st.integers(0, len(request.arguments) - 1))
    field = request.command.request[place]
    beyond = data.draw(st.integers(field.high + 1, 9_999_999_999))
    numbers = list(request.arguments)
    numbers[place] = beyond
    line = Request(request.letter, tuple(numbers)).encode().rstrip(b"\n")
    if field.beyond is Beyond.REJECT:
        with pytest.raises(RequestError) as caught:
            parse_request(line)
        assert caught.value.reply == "z,Protocol error"
    else:
        assert parse_request(line).arguments[place] == field.high


def test_a_line_ends_with_cr_lf() -> None:
    assert encode_line("d") == b"d\r\n"
