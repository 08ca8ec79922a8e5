"""Writes the pages of the reference that code can tell: python docs/generate.py."""

import sys
from collections.abc import Callable
from itertools import groupby
from pathlib import Path
from typing import Final, get_args

from khepera_protocol.epuck.codes import SOUND_BUFFER, Code
from khepera_protocol.epuck.generations import BTCOM, GCTRONIC, GCTRONIC2, Generation
from khepera_protocol.epuck.letters import LETTERS, Letter
from khepera_protocol.options import parameters
from khepera_protocol.serial.commands import COMMANDS, TOOLS, Beyond, Field
from typer.core import TyperGroup
from typer.main import get_command
from typer.testing import CliRunner

from khepera_emulator.app.cli.commands import app as emulator
from khepera_emulator.robot.options import UrlOptions
from macor_hil.cli.program import app as controller
from macor_hil.telemetry.keys_page import keys_page

DOCS = Path(__file__).parent

PROGRAMS: Final = {"macor-hil": controller, "khepera-emulator": emulator}

_NARROW = {"COLUMNS": "100", "TERM": "dumb", "NO_COLOR": "1"}


def commands_page() -> str:
    """Return the help of both programs and all of their commands."""
    lines = [
        "# The command lines",
        "",
        "What `--help` says, on one page; `python docs/generate.py` writes it.",
    ]
    for name, app in PROGRAMS.items():
        lines += ["", f"## {name}", "", *_help(name)]
        group = get_command(app)
        assert isinstance(group, TyperGroup)
        for command in group.commands:
            lines += ["", f"### {name} {command}", "", *_help(name, command)]
    return "\n".join([*lines, *_url_options()]) + "\n"


def _url_options() -> list[str]:
    """Return the options of `khepera://` URLs."""
    lines = [
        "",
        "## khepera:// URLs",
        "",
        "`khepera://ARENA?NAME=VALUE&...`: a robot in the process of a pySerial program, as in",
        "[the ports](ports.md#in-process). ARENA is a name, or the path of a TOML file, in which",
        "`%`, `#` and `?` are written as `%25`, `%23` and `%3F`; without it it is the corridor.",
        "",
        "| option | what it is | without it |",
        "|---|---|---|",
    ]
    for parameter in parameters(UrlOptions):
        name, info = parameter.name.replace("_", "-"), get_args(parameter.annotation)[1]
        if name != "arena":
            default = "" if parameter.default in (None, []) else f"`{parameter.default}`"
            lines.append(f"| `{name}` | {_cell(info.help)} | {default} |")
    return lines


def _help(program: str, *command: str) -> list[str]:
    runner = CliRunner(env=_NARROW)
    said = runner.invoke(PROGRAMS[program], [*command, "--help"], prog_name=program).output
    lines = "\n".join(line.rstrip() for line in said.splitlines())
    return ["```text", lines.strip("\n"), "```"]


def protocol_page() -> str:
    """Return the table of serial commands."""
    lines = [
        "# The serial protocol",
        "",
        "The requests that a Khepera answers, from the table that both ends are built on",
        "(`khepera_protocol.serial.commands`; `python docs/generate.py` writes this page). A",
        "request is a letter and its numbers, separated by commas, and ends with CR or LF; the",
        "reply begins with the letter in lower case and ends with CR LF. What is no request gets",
        "`z,Protocol error`. Where the manual is silent, see [choices](khepera-choices.md).",
        "",
        "| letter | command | request | reply |",
        "|---|---|---|---|",
    ]
    for command in COMMANDS.values():
        text = ", text" if command.open_ended else ""
        request = _fields(command.request, asked=True) + text
        reply = _fields(command.reply, asked=False) + text
        lines.append(f"| `{command.letter}` | {command.title} | {request} | {reply} |")
    lines += [
        "",
        "A number that is out of range gets `z,Protocol error`; where *nearest* stands, the robot",
        "takes the nearest one of the range instead.",
        "",
        "## Tools of the ROM",
        "",
        "| word | what it does |",
        "|---|---|",
        *(f"| `{word}` | {what} |" for word, what in TOOLS.items()),
    ]
    return "\n".join(lines) + "\n"


_GOLDEN: Final = DOCS.parent / "tests" / "golden"
_PUCKS: Final[dict[str, tuple[Generation, tuple[str, ...]]]] = {
    "e-puck, GCtronic 1.2.2": (GCTRONIC, ("epuck-letters", "epuck-rows")),
    "e-puck, BTcom 2.0.0": (BTCOM, ("epuck-btcom",)),
    "e-puck2, GCtronic 2.0": (GCTRONIC2, ("epuck2-letters", "epuck2-rows")),
}
_LONGEST_ROW: Final = 40
"""Characters of bytes that a table shows."""


def epuck_page() -> str:
    """Return the tables of the e-pucks' requests, each with what an emulated robot answers."""
    names = list(_PUCKS)
    lines = [
        "# The protocol of the e-pucks",
        "",
        "Requests in text and in binary rows of three firmwares, from the tables that both ends",
        "are built on (`khepera_protocol.epuck`), and the answer to each in a golden transcript",
        "(`tests/golden`; `python docs/generate.py` writes this page). How they are read, and what",
        "is modelled behind them, is told in [the e-puck](epuck.md).",
        "",
        "## Requests in text",
        "",
        "A letter and its numbers, separated by commas; CR, LF or both end it.",
        "",
        f"| letter | what it does | numbers | {' | '.join(names)} |",
        f"|---|---|---|{'---|' * len(names)}",
    ]
    for letter in LETTERS.values():
        answers = [_golden_line(letter, *_PUCKS[name]) for name in names]
        cells = [f"`{letter.letter}`", letter.title, ", ".join(letter.request), *answers]
        lines.append(f"| {' | '.join(cells)} |")
    lines += [
        "",
        "## Binary requests",
        "",
        "Command bytes with their parameters in a row that ends with 00; the answers come together",
        "behind it. Numbers are little-endian.",
        "",
        f"| byte | letter | what it does | parameters | {' | '.join(names)} |",
        f"|---|---|---|---|{'---|' * len(names)}",
    ]
    codes: dict[int, Code] = {}
    for generation, _ in _PUCKS.values():
        codes = {**generation.codes, **codes}
    for byte, code in sorted(codes.items(), key=lambda item: _place(item[1])):
        answers = [_golden_row(code, *_PUCKS[name]) for name in names]
        name = "" if code.name.startswith("0x") else f"`{code.name}`"
        cells = [f"{byte:02X}", name, code.title, str(code.parameters or ""), *answers]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _golden_line(letter: Letter, generation: Generation, files: tuple[str, ...]) -> str:
    """Return the golden answer to a letter, as a cell."""
    if letter.letter in generation.silent:
        return "nothing"
    if letter.letter not in generation.letters:
        return "`z,Command not found`"
    answers = _answers(files, "> ", "< ", lambda text: text[:1] == letter.letter)
    if not answers:
        return "nothing"
    first = [line for line in answers[0] if line != "\\x0a"]
    more = f" and {len(first) - 2} more lines" if len(first) > 2 else ""
    return "; ".join(f"`{_cell(line)}`" for line in first[:2]) + more


def _golden_row(code: Code, generation: Generation, files: tuple[str, ...]) -> str:
    """Return the golden answer to a command byte alone in its row, as a cell."""
    known = generation.codes.get(code.byte)
    if known is None:
        return "passed over"
    answers = _answers(files, ">> ", "<< ", lambda text: _is_alone(text, known))
    data = " ".join(answers[0]) if answers and answers[0] else ""
    if not data:
        return "nothing"
    size = "picture" if known.answer is None else f"{_size(known)} bytes"
    return f"{size}: `{data[:_LONGEST_ROW]}{'...' if len(data) > _LONGEST_ROW else ''}`"


def _place(code: Code) -> tuple[bool, str]:
    """Return a key to sort by: letters first."""
    return code.name.startswith("0x"), code.name.lower() + code.name


def _size(code: Code) -> str:
    return f"{SOUND_BUFFER} and {code.answer}" if code.name == "U" else str(code.answer)


def _is_alone(text: str, code: Code) -> bool:
    data = bytes.fromhex(text)
    return data[:1] == bytes([code.byte]) and len(data) == code.parameters + 2 and not data[-1]


def _answers(
    files: tuple[str, ...], asked: str, said: str, fits: Callable[[str], bool]
) -> list[list[str]]:
    """Return the answers to the requests that fit, in golden transcripts."""
    found: list[list[str]] = []
    for name in files:
        listening = False
        for line in (_GOLDEN / f"{name}.txt").read_text("utf-8").splitlines():
            if line.startswith(">"):
                listening = line.startswith(asked) and fits(line.removeprefix(asked))
                if listening:
                    found.append([])
            elif listening and line.startswith(said):
                found[-1].append(line.removeprefix(said))
    return found


PAGES = {
    "keys.md": keys_page,
    "commands.md": commands_page,
    "protocol.md": protocol_page,
    "epuck-protocol.md": epuck_page,
}
"""Pages by file name."""


def _fields(fields: tuple[Field, ...], *, asked: bool) -> str:
    """Describe the fields of a request or a reply, neighbours of one range and unit together."""
    groups = groupby(fields, key=lambda field: _details(field, asked=asked))
    return _cell(
        ", ".join(
            ", ".join(field.name for field in group) + (f" ({details})" if details else "")
            for details, group in groups
        )
    )


def _details(field: Field, *, asked: bool) -> str:
    if field.low == field.high:
        return ""
    details = [f"{field.low} to {field.high}"]
    if field.unit:
        details.append(field.unit)
    if asked and field.beyond is Beyond.CLAMP:
        details.append("*nearest*")
    return "; ".join(details)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")


def main() -> None:
    """Write the pages."""
    for name, page in PAGES.items():
        (DOCS / name).write_text(page(), "utf-8")
        sys.stdout.write(f"{DOCS / name}\n")


if __name__ == "__main__":
    main()
