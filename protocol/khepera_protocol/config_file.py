"""One TOML file for a program, checked and printed: the command `config`.

The file has a table for each command that takes options from it; what options there are, their
defaults, bounds and descriptions are said in their models alone (`options`):

    [run]
    port = "/dev/ttyUSB0"
    commands = 0
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Annotated, Any, Final

import typer
from pydantic import ValidationError

from khepera_protocol.options import (
    CONFIG,
    OptionError,
    outside,
    read_document,
    values_in,
)
from khepera_protocol.text import did_you_mean, printable, quoted
from khepera_protocol.validation import problems

_WIDTH: Final = 98


def add_config(app: typer.Typer, service: str) -> None:
    """Add the command `config` to a program.

    Args:
        app: the program.
        service: name of the command that options without a table are taken for.
    """

    @app.command(
        name=CONFIG,
        epilog="[cyan]config --print run > options.toml[/cyan]\n\n"
        "[cyan]config --check options.toml[/cyan]",
    )
    def config(
        context: typer.Context,
        commands: Annotated[
            list[str] | None,
            typer.Argument(metavar="COMMAND...", help="Only these commands, not all."),
        ] = None,
        check: Annotated[
            Path | None,
            typer.Option(metavar="FILE", help="Check a file of options.", show_envvar=False),
        ] = None,
        show: Annotated[
            bool,
            typer.Option(
                "--print",
                help="Print all options as such a file: as the environment and the checked file"
                " set them, else their defaults.",
                show_envvar=False,
            ),
        ] = False,
    ) -> None:
        """Check or print a TOML file of options, for --config.

        A file has a table for each command; without a table, options are those of the command that
        the file is given to: checked as those of COMMAND, or of the first one that has them all.
        """
        if check is None and not show:
            raise typer.BadParameter("give --check FILE, --print, or both")
        there = commands_of(context.parent)
        names = _known(commands or list(there), there)
        tables = check_file(check, there, service, commands) if check else {}
        if show:
            parts = [_printed(there[name], tables.get(name, {}), context) for name in names]
            typer.echo("\n".join(parts), nl=False)
        else:
            where = printable(str(check))
            used = f"can be used by {', '.join(tables)}" if tables else "has no options"
            typer.echo(f"{where} {used}")


def commands_of(program: Any) -> dict[str, Any]:
    """Return the commands of a program that take a file of options, by their names."""
    every: Mapping[str, Any] = getattr(program and program.command, "commands", {})
    return {
        name: command
        for name, command in every.items()
        if any(each.name == CONFIG for each in command.params)
    }


def check_file(
    path: Path, commands: Mapping[str, Any], service: str, named: Sequence[str] | None = None
) -> dict[str, dict[str, Any]]:
    """Return what a file says of each command.

    Args:
        path: of the file.
        commands: those that there are.
        service: the command that options without a table are of, if it has them.
        named: the command that they are of in any case, first.

    Raises:
        OptionError: the file cannot be read, names what there is not, or a value does not fit.
    """
    where = printable(str(path))
    document = read_document(path)
    tables = {name: value for name, value in document.items() if isinstance(value, dict)}
    flat = {name: value for name, value in document.items() if name not in tables}
    if flat:
        owner = named[0] if named else _owner(flat, commands, service)
        tables[owner] = {**flat, **tables.get(owner, {})}
    made = {}
    for name, table in tables.items():
        try:
            _known([name], commands)
            made[name] = values_in(table, commands[name])
            _check(commands[name], made[name])
        except OptionError as error:
            raise OptionError(f"{where}: [{printable(name, 40)}] {error}") from None
    return made


def _owner(flat: Mapping[str, Any], commands: Mapping[str, Any], service: str) -> str:
    """Return the command that options without a table are of: the service where none has all."""

    def has_them(name: str) -> bool:
        try:
            values_in(flat, commands[name])
        except OptionError:
            return False
        return True

    return next(filter(has_them, (service, *commands)), service)


def _known(names: list[str], commands: Mapping[str, Any]) -> list[str]:
    for name in names:
        if name not in commands:
            raise OptionError(
                f"no command {quoted(name)} takes options from a file;"
                f" {did_you_mean(name, commands)}there are {', '.join(commands)}"
            )
    return names


def _check(command: Any, values: Mapping[str, Any]) -> None:
    for model in command.callback.models:
        own = {name: values[name] for name in model.model_fields if name in values}
        try:
            model.model_validate(own)
        except ValidationError as error:
            # what a command must be given may stand on its command line
            if wrong := problems(error, outside, partly=True):
                raise OptionError(wrong) from None


def _printed(command: Any, values: Mapping[str, Any], context: typer.Context) -> str:
    """Return the table of a command, every option under its description."""
    assert context.parent is not None
    read = command.make_context(
        command.name, [], parent=context.parent, resilient_parsing=True, default_map=dict(values)
    )
    lines = [f"[{command.name}]"]
    fields = {name for model in command.callback.models for name in model.model_fields}
    for option in command.params:
        if option.name in fields:
            text = (option.help or "").replace("\\[", "[")
            lines += [f"# {line}" for line in wrap(text, _WIDTH)]
            lines.append(_assigned(option, read.params.get(option.name)))
    return "\n".join(lines) + "\n"


def _assigned(option: Any, value: object) -> str:
    key = max(option.opts, key=len).lstrip("-")
    return f"# {key} =" if value is None else f"{key} = {_toml(value)}"


def _toml(value: object) -> str:
    """Return a value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return str(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return json.dumps(str(value))
