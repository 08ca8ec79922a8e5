"""Commands that are imported when they are asked for: a list of all of them imports none.

Each part of the command line is a module with a Typer application `app`. Which commands it has, and
what they do in a sentence, is read in its source, where it is said.
"""

import ast
from collections.abc import Iterator, Mapping, MutableMapping
from copy import copy
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

from typer.core import TyperCommand, TyperGroup
from typer.main import get_group

Described = tuple[str, str | None]
"""Module of a command, and what it does."""


class Commands(MutableMapping[str, Any]):
    """Commands by their names, in order.

    Args:
        modules: with an `app` each.
        first: module and description of commands that no source shows.
    """

    def __init__(self, modules: tuple[str, ...], first: Mapping[str, Described]) -> None:
        self._modules = modules
        self._first = first
        self._made: dict[str, Any] = {}

    @cached_property
    def told(self) -> dict[str, Described]:
        """Module and description of each command."""
        found = {name: (each, text) for each in self._modules for name, text in _described(each)}
        return {**self._first, **found}

    def __iter__(self) -> Iterator[str]:
        yield from dict.fromkeys([*self.told, *self._made])

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __contains__(self, name: object) -> bool:
        return name in self.told or name in self._made

    def __getitem__(self, name: str) -> Any:
        if name not in self._made:
            module = import_module(self.told[name][0])
            for each, command in get_group(module.app).commands.items():
                self._made.setdefault(each, command)
        return self._made[name]

    def __setitem__(self, name: str, command: Any) -> None:
        self._made[name] = command

    def __delitem__(self, name: str) -> None:
        del self._made[name]


class Parts(TyperGroup):
    """A program whose commands are those of modules.

    Attributes:
        modules: with an `app` each.
        first: module and description of commands that no source shows; they come first.
    """

    modules: ClassVar[tuple[str, ...]] = ()
    first: ClassVar[Mapping[str, Described]] = {}

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.commands = Commands(self.modules, self.first)

    def list_commands(self, ctx: Any) -> list[str]:
        """Return all names, in order."""
        del ctx
        return list(self.commands)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, in which commands are no more than a name and a sentence."""
        listed = copy(self)
        commands = self.commands
        assert isinstance(commands, Commands)
        told = commands.told.items()
        listed.commands = {name: TyperCommand(name, help=text) for name, (_, text) in told}
        TyperGroup.format_help(listed, ctx, formatter)


def _described(module: str) -> Iterator[tuple[str, str | None]]:
    """Yield the name and the description of each command in a module's source."""
    spec = find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    for node in ast.parse(Path(spec.origin).read_bytes()).body:
        if isinstance(node, ast.FunctionDef):
            for decorator in node.decorator_list:
                match decorator:
                    case ast.Call(func=ast.Attribute(ast.Name("app"), "command"), keywords=given):
                        names = [each.value for each in given if each.arg == "name"]
                        yield _name(node, names), ast.get_docstring(node)


def _name(function: ast.FunctionDef, given: list[ast.expr]) -> str:
    """Return the name of a function's command."""
    match given:
        case [ast.Constant(value=str(name))]:
            return name
    return function.name.replace("_", "-")
