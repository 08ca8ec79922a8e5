"""Writes man pages of both programs and all of their commands: python docs/man.py FOLDER."""

import re
import sys
from collections.abc import Iterator
from importlib.metadata import version
from inspect import cleandoc
from pathlib import Path
from typing import Any, Final

import typer
from rich.text import Text
from typer.core import TyperGroup
from typer.main import get_command

from khepera_emulator.app.cli.commands import app as emulator
from macor_hil.cli.program import app as controller

PROGRAMS: Final = {"macor-hil": controller, "khepera-emulator": emulator}

_DISTRIBUTION: Final = "khepera-macor"


def man_pages() -> Iterator[tuple[str, str]]:
    """Yield the file name and the text of every page."""
    for program, app in PROGRAMS.items():
        group = get_command(app)
        assert isinstance(group, TyperGroup)
        yield (
            f"{program}.1",
            _page(program, group, [f"{program}-{each}" for each in group.commands]),
        )
        for name, command in group.commands.items():
            yield f"{program}-{name}.1", _page(f"{program} {name}", command, [program])


def _page(name: str, command: Any, also: list[str]) -> str:
    """Return a page in the language of man."""
    first, _, rest = cleandoc(_plain(command.help)).partition("\n\n")
    title, context = name.replace(" ", "-"), typer.Context(command, info_name=name)
    lines = [f'.TH "{title.upper()}" "1" "" "{_DISTRIBUTION} {version(_DISTRIBUTION)}"']
    lines += [".SH NAME", _escaped(f"{title} - {_in_one_line(first)}")]
    lines += [".SH SYNOPSIS"]
    lines += [_escaped(" ".join([name, *command.collect_usage_pieces(context)]))]
    if rest:
        lines.append(".SH DESCRIPTION")
        lines += [f"{_escaped(_in_one_line(part))}\n.PP" for part in rest.split("\n\n")]
    if isinstance(command, TyperGroup):
        lines.append(".SH COMMANDS")
        for each, inner in command.commands.items():
            summary = cleandoc(_plain(inner.help)).partition("\n\n")[0]
            lines += _item(each, _in_one_line(summary))
    lines.append(".SH OPTIONS")
    for param in command.params:
        head, text = param.get_help_record(context)
        # what follows the help, the default and bounds, is in brackets that are no markup
        about = param.help or ""
        lines += _item(head, f"{_plain(about)}{text.removeprefix(about)}")
    lines += _epilog(command.epilog or "")
    lines += [".SH SEE ALSO", _escaped(", ".join(f"{each}(1)" for each in also))]
    return "\n".join([*lines, ""])


def _item(head: str, text: str) -> list[str]:
    """Return a term in bold and what it is."""
    return [".TP", _escaped(f".B {head}", macro=True), _escaped(_in_one_line(text))]


def _epilog(marked: str) -> list[str]:
    """Return the sections that follow the options: examples, unless a heading says otherwise."""
    lines: list[str] = []
    for paragraph in filter(None, cleandoc(marked).split("\n\n")):
        heading = re.fullmatch(r"\[bold\](.*)\[/bold\]", paragraph)
        if heading or not lines:
            lines.append(f".SH {(heading[1] if heading else 'examples').upper()}")
        if heading:
            continue
        lines.append(".PP")
        for line in paragraph.splitlines():
            if line.startswith("[cyan]"):  # a command keeps its line
                lines += [".RS 4", ".nf", _escaped(f".B {_plain(line)}", macro=True), ".fi", ".RE"]
            else:
                lines.append(_escaped(_plain(line)))
    return lines


def _plain(marked: str | None) -> str:
    """Return a text without Rich's markup."""
    return Text.from_markup(marked or "").plain


def _in_one_line(text: str) -> str:
    return " ".join(text.split())


def _escaped(text: str, *, macro: bool = False) -> str:
    """Return a text that man shows as it is."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return text if macro or not text.startswith((".", "'")) else f"\\&{text}"


def main() -> None:
    """Write the pages."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in man_pages():
        (folder / name).write_text(text, "utf-8")
    sys.stdout.write(f"{folder}\n")


if __name__ == "__main__":
    main()
