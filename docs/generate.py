"""Writes the pages of the reference that code can tell: python docs/generate.py."""

import sys
from itertools import groupby
from pathlib import Path
from typing import Final, get_args

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


PAGES = {"keys.md": keys_page, "commands.md": commands_page, "protocol.md": protocol_page}
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
