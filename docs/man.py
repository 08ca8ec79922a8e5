"""Writes man pages of both programs and all of their commands: python docs/man.py FOLDER."""

import sys
from collections.abc import Iterator
from importlib.metadata import version
from inspect import cleandoc
from pathlib import Path
from typing import Any, Final

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
    title, about = name.replace(" ", "-"), " ".join(first.split())
    lines = [f'.TH "{title.upper()}" "1" "" "{_DISTRIBUTION} {version(_DISTRIBUTION)}"']
    lines += [".SH NAME", _escaped(f"{title} - {about}")]
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    words = [name, "[OPTIONS]", *(each.name.upper() for each in arguments)]
    lines += [".SH SYNOPSIS", _escaped(" ".join(words))]
    if rest:
        lines.append(".SH DESCRIPTION")
        lines += [_escaped(" ".join(part.split())) + "\n.PP" for part in rest.split("\n\n")]
    lines.append(".SH OPTIONS")
    for param in command.params:
        known = [] if param in arguments else [*param.opts, *param.secondary_opts]
        heads = known or [param.name.upper()]
        lines += [
            ".TP",
            _escaped(f".B {', '.join(heads)}", macro=True),
            _escaped(_plain(param.help)),
        ]
    if command.epilog:
        lines += [".SH EXAMPLES", _escaped(" ".join(_plain(command.epilog).split()))]
    lines += [".SH SEE ALSO", _escaped(", ".join(f"{each}(1)" for each in also))]
    return "\n".join([*lines, ""])


def _plain(marked: str | None) -> str:
    """Return a text without Rich's markup."""
    return Text.from_markup(marked or "").plain


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
