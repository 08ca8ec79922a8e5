"""Requests and replies as values, built and parsed from the command table."""

import re
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Final, NamedTuple

from khepera_protocol.serial.commands import COMMANDS, TOOLS, Beyond, Command, Field
from khepera_protocol.serial.errors import ReplyError, RequestError
from khepera_protocol.serial.framing import LINE_END

BANNER: Final = (b"ROM of minirobot", b"Serial Communication Protocol")
"""Beginnings of the lines that a Khepera says when it starts."""

COMMAND_NOT_FOUND: Final = "Command not found"
"""Answer to an unknown word, a lone blank, or garbage (seen on a real robot, ROM 5.01)."""

PROTOCOL_ERROR: Final = "z,Protocol error"
"""Answer to a known letter with arguments that are missing, too many or no numbers."""

TURRET_NOT_SUPPORTED: Final = "z,Turret order not supported"
"""Answer to a message for a turret that is not mounted."""

_NUMBER = re.compile(r" *(-?[0-9]{1,10}) *", re.ASCII)
_VERSION = re.compile(r"[0-9]\.[0-9]{2}", re.ASCII)

_INTEGER_REPLIES: Final = MappingProxyType(
    {
        letter: re.compile(
            b"%b(?:, *-?[0-9]{1,10} *){%d}" % (letter.lower().encode(), len(row.reply))
        )
        for letter, row in COMMANDS.items()
        if not (row.open_ended or row.reply_is_text)
    }
)
"""Patterns of whole good replies, where all values are integers."""

_REMEMBERED: Final = 512
"""Different requests whose meaning is remembered: a program sends the same ones again and again."""


class Request(NamedTuple):
    """A command with its arguments, all of them inside the ranges of the table.

    Attributes:
        letter: a key of `COMMANDS`.
        arguments: one integer for each request field.
        rest: what a turret message passes on, split at its commas; empty for other commands.
    """

    letter: str
    arguments: tuple[int, ...] = ()
    rest: tuple[str, ...] = ()

    @property
    def command(self) -> Command:
        """The row of the table."""
        return COMMANDS[self.letter]

    def encode(self) -> bytes:
        """Return the request as bytes on the line, ended with LF as most clients do."""
        return ",".join((self.letter, *map(str, self.arguments), *self.rest)).encode() + b"\n"


@dataclass(frozen=True, slots=True)
class ToolCall:
    """A ROM tool with its arguments."""

    word: str
    arguments: tuple[str, ...] = ()


class Reply(NamedTuple):
    """The robot's answer to a request.

    Attributes:
        letter: lower-case letter.
        values: integers, one a reply field; empty where the reply is text.
        text: words, for versions and for what a turret answers.
    """

    letter: str
    values: tuple[int, ...] = ()
    text: tuple[str, ...] = ()

    def encode(self) -> bytes:
        """Return the reply as bytes on the line."""
        letter, values, text = self
        return ",".join((letter, *map(str, values), *text)).encode("ascii") + LINE_END


def encode_line(text: str) -> bytes:
    """Return a line as the robot sends it: ASCII, ended with CR LF."""
    return text.encode("ascii") + LINE_END


@lru_cache(_REMEMBERED, typed=True)
def build_request(letter: str, *arguments: int, rest: tuple[str, ...] = ()) -> Request:
    """Return a request, checked against the table.

    Raises:
        RequestError: unknown letter, wrong number of arguments, or a number out of range.
    """
    command = COMMANDS.get(letter)
    if command is None:
        raise RequestError(COMMAND_NOT_FOUND, f"{letter!r} is no command of a Khepera")
    if len(arguments) != len(command.request):
        raise RequestError(
            PROTOCOL_ERROR,
            f"{letter} takes {len(command.request)} argument(s), got {len(arguments)}",
        )
    for field, value in zip(command.request, arguments, strict=True):
        if not field.low <= value <= field.high:
            raise RequestError(
                PROTOCOL_ERROR,
                f"{letter}: {field.name} must be {field.low} to {field.high}, got {value}",
            )
    return Request(letter, arguments, rest)


@lru_cache(_REMEMBERED, typed=True)
def parse_request(
    line: bytes, reject_beyond: bool = False, ignore_extra: bool = True
) -> Request | ToolCall:
    """Read one request line, without its line end, as the robot does.

    Args:
        line: what came between two line ends.
        reject_beyond: refuse every number out of range, also where the table says to clamp.
        ignore_extra: take no notice of arguments to a command that has none, as KiKS does.

    Raises:
        RequestError: with the robot's answer in `reply`.
    """
    try:
        text = line.decode("ascii")
    except UnicodeDecodeError:
        raise RequestError(COMMAND_NOT_FOUND, f"{line!r} is not ASCII") from None
    word, *arguments = text.split(",")
    command = COMMANDS.get(word.rstrip(" "))
    if command is not None:
        if ignore_extra and not command.request:
            return Request(command.letter)
        return _parse_arguments(command, arguments, reject_beyond)
    words = text.split()
    if words and not text.startswith(" ") and words[0] in TOOLS:
        return ToolCall(words[0], tuple(words[1:]))
    raise RequestError(COMMAND_NOT_FOUND, f"{text!r} begins with no command or tool")


def _parse_arguments(command: Command, arguments: list[str], reject_beyond: bool) -> Request:
    needed = len(command.request)
    if len(arguments) < needed + command.open_ended or (
        len(arguments) > needed and not command.open_ended
    ):
        raise RequestError(PROTOCOL_ERROR, f"{command.letter} takes {needed} argument(s)")
    numbers = tuple(
        parse_number(field, argument, reject_beyond=reject_beyond)
        for field, argument in zip(command.request, arguments, strict=False)
    )
    return Request(command.letter, numbers, tuple(arguments[needed:]))


def parse_number(field: Field, argument: str, *, reject_beyond: bool = False) -> int:
    """Return the number of a field as it stands in a request; blanks around it do not count.

    Raises:
        RequestError: no integer, or one out of range that the field does not clamp.
    """
    match = _NUMBER.fullmatch(argument)
    if match is None:
        raise RequestError(PROTOCOL_ERROR, f"{field.name}: {argument!r} is not an integer")
    value = int(match[1])
    if field.low <= value <= field.high:
        return value
    if reject_beyond or field.beyond is Beyond.REJECT:
        raise RequestError(PROTOCOL_ERROR, f"{field.name}: {value} is out of range")
    return min(max(value, field.low), field.high)


def parse_reply(request: Request, line: bytes) -> Reply:
    """Read the reply line, without its line end, that belongs to a request.

    Raises:
        ReplyError: another letter, an error reply, a wrong number of values, or no integers.
    """
    pattern = _INTEGER_REPLIES.get(request.letter)
    if pattern is not None and pattern.fullmatch(line):
        # nearly every reply: nothing is left to check
        return Reply(request.letter.lower(), tuple(map(int, line.split(b",")[1:])))
    return _parse_by_table(request, line)


def _parse_by_table(request: Request, line: bytes) -> Reply:
    """Read any reply, or say what is wrong with it."""

    def error(reason: str) -> ReplyError:
        return ReplyError(request.encode(), line, reason)

    command = request.command
    try:
        head, *words = line.decode("ascii").split(",")
    except UnicodeDecodeError:
        raise error("the reply is not ASCII; is the baud rate right?") from None
    if head != command.letter.lower():
        raise error("the robot refused the request" if _is_refusal(line) else "another reply")
    if command.open_ended:
        if not words or words[0] != str(request.arguments[0]):
            raise error("a reply of another turret")
        return Reply(head, (int(words[0]),), tuple(words[1:]))
    if len(words) != len(command.reply):
        raise error(f"{len(command.reply)} value(s) expected, got {len(words)}")
    if command.reply_is_text:
        if not all(_VERSION.fullmatch(word) for word in words):
            raise error("versions of the form d.dd expected")
        return Reply(head, text=tuple(words))
    if not all(map(is_integer, words)):
        raise error("integers expected")
    return Reply(head, tuple(map(int, words)))


def is_integer(word: str) -> bool:
    """Return whether a word of a request or reply is an integer of at most ten digits."""
    return _NUMBER.fullmatch(word) is not None


def _is_refusal(line: bytes) -> bool:
    return line.startswith(b"z,") or line == COMMAND_NOT_FOUND.encode()
