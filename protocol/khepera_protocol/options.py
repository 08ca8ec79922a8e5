"""Options declared once, as typed models: command line, environment and TOML file follow from them.

A model's field is an option: its type, default, bounds and description are said there and nowhere
else. `takes(Model)` turns a function of such models into a command of Typer:

    class Size(BaseModel):
        width: int = Field(default=3, ge=1, description="Metres.")

    @app.command()
    @takes(Size)
    def build(size: Size) -> None: ...

gives `build --width 4`. With `--config FILE` a TOML file gives values, by the options' names; what
stands on the command line wins over the environment (PROGRAM_COMMAND_OPTION), that over the file.
A file for a whole program has a table for each command, such as `[build]` (`config_file`).
"""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar, get_args, get_origin

import typer
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from khepera_protocol.text import (
    MAX_DOCUMENT,
    DocumentError,
    did_you_mean,
    parse_toml,
    printable,
    quoted,
)
from khepera_protocol.text import OptionError as OptionError
from khepera_protocol.validation import problems


@dataclass(frozen=True)
class Cli:
    """The look of an option on the command line, where its field does not say it.

    Attributes:
        flags: such as `--map`; none: the field's name with dashes.
        metavar: stands for the value in the help.
        argument: it is given by its place and not by a name.
        show_default: text that stands for the default in the help.
        envvar: a name of the environment that is known to others, too.
        names: lists what stands for `{names}` in the description, when a command is made.
    """

    flags: tuple[str, ...] = ()
    metavar: str | None = None
    argument: bool = False
    show_default: str | None = None
    envvar: str | None = None
    names: Callable[[], Iterable[str]] | None = None


CONFIG: Final = "config"

_M = TypeVar("_M", bound=BaseModel)


def takes(*models: type[BaseModel], config: bool = True) -> Callable[..., Callable[..., None]]:
    """Turn a function of models, in their order, into one of all their fields, for Typer.

    Args:
        models: their fields become the command's options, in this order.
        config: whether the command has `--config`.
    """

    def decorate(function: Callable[..., None]) -> Callable[..., None]:
        names = list(inspect.signature(function).parameters)

        @wraps(function)
        def command(**values: Any) -> None:
            values.pop(CONFIG, None)
            made = [checked(model, values, _flag) for model in models]
            function(*made, **values)

        command.models = models  # type: ignore[attr-defined]
        own = inspect.signature(function).parameters
        rest = [own[name] for name in names[len(models) :]]
        options = [each for model in models for each in parameters(model)]
        if config:
            options.append(_CONFIG_OPTION)
        both = sorted([*options, *rest], key=lambda each: not _is_argument(each))
        command.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in both]
        )
        command.__annotations__ = {each.name: each.annotation for each in both}
        return command

    return decorate


def parameters(model: type[BaseModel]) -> list[inspect.Parameter]:
    """Return a model's fields as parameters that Typer understands."""
    return [_parameter(name, field) for name, field in model.model_fields.items()]


def from_strings(model: type[_M], pairs: Iterable[tuple[str, str]]) -> _M:
    """Make a model from names and values as text, as a URL has them.

    Raises:
        OptionError: a name is unknown, stands twice, or has a value that does not fit.
    """
    values: dict[str, Any] = {}
    for name, text in pairs:
        field = _field_of(model, name)
        if _is_list(model.model_fields[field].annotation):
            values.setdefault(field, []).append(text)
        elif field in values:
            raise OptionError(f"{name} is given twice")
        else:
            values[field] = text
    return checked(model, values, outside)


def to_strings(options: BaseModel, *, defaults: bool = False) -> list[tuple[str, str]]:
    """Return options as names and values of a URL.

    Args:
        options: the model.
        defaults: whether to name those that have their default, too; what is None never is.
    """
    pairs = []
    for name, field in type(options).model_fields.items():
        value = getattr(options, name)
        default = field.get_default(call_default_factory=True)
        if value is None or (value == default and not defaults):
            continue
        values = value if isinstance(value, list | tuple) else [value]
        pairs += [(outside(name), str(each)) for each in values]
    return pairs


def read_document(path: Path) -> dict[str, Any]:
    """Read a TOML file of options, whatever it says.

    Raises:
        OptionError: it cannot be read, or is no TOML.
    """
    try:
        with path.open("rb") as file:
            return parse_toml(file.read(MAX_DOCUMENT + 1))
    except OSError as error:
        raise OptionError(f"cannot read {printable(str(path))}: {error.strerror}") from None
    except DocumentError as error:
        raise OptionError(f"{printable(str(path))}: {error}") from None


def values_in(table: Mapping[str, Any], command: Any) -> dict[str, Any]:
    """Return the values of a command's fields that a table of a file gives.

    Args:
        table: keys are options' names, with dashes or underscores.
        command: of Typer.

    Raises:
        OptionError: it names an option that there is not, or a value is a table.
    """
    options = {
        _written(each): each for each in command.params if each.name not in (None, CONFIG, "help")
    }
    values = {}
    for key, value in table.items():
        option = options.get(key.replace("-", "_"))
        if option is None:
            raise OptionError(_unknown(key, list(options)))
        if isinstance(value, dict):
            raise OptionError(f"{key} is a value, not a table")
        several = option.multiple and not isinstance(value, list)
        values[option.name] = [value] if several else value
    return values


def checked(model: type[_M], values: dict[str, Any], shown: Callable[[object], str]) -> _M:
    """Make a model from those values that are its fields', and take them away.

    Args:
        model: of the options.
        values: of its fields, and others.
        shown: says what a field is called where the values come from.

    Raises:
        OptionError: one does not fit, or is missing.
    """
    own = {name: values.pop(name) for name in model.model_fields if name in values}
    try:
        return model.model_validate(own)
    except ValidationError as error:
        raise OptionError(problems(error, shown)) from None


def _parameter(name: str, field: FieldInfo) -> inspect.Parameter:
    cli = next((each for each in field.metadata if isinstance(each, Cli)), Cli())
    bounds = {
        bound: getattr(each, limit)
        for each in field.metadata
        for bound, limit in (("min", "ge"), ("max", "le"))
        if hasattr(each, limit)
    }
    default = field.get_default(call_default_factory=True)
    kind: Any = field.annotation
    if _is_list(kind):
        (item, *_) = get_args(kind)
        kind, default = list[item], list(default)  # type: ignore[valid-type]
    text = field.description
    if text and cli.names:
        text = text.replace("{names}", ", ".join(cli.names()))
    given: dict[str, Any] = {
        "help": text,
        "metavar": cli.metavar,
        "envvar": cli.envvar,
        "show_envvar": cli.envvar is not None,
        **bounds,
    }
    if cli.show_default is not None:
        given["show_default"] = cli.show_default
    info = typer.Argument(**given) if cli.argument else typer.Option(*cli.flags, **given)
    if field.is_required():
        default = inspect.Parameter.empty
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, info]
    )


def _is_list(kind: Any) -> bool:
    return get_origin(kind) in (list, tuple)


def _is_argument(parameter: inspect.Parameter) -> bool:
    return any(
        isinstance(each, typer.models.ArgumentInfo) for each in get_args(parameter.annotation)
    )


def outside(name: object) -> str:
    """Return what a field is called in files and in URLs; on the command line with two dashes."""
    return str(name).replace("_", "-")


def _flag(name: object) -> str:
    """Return what a field is called on the command line."""
    return f"--{outside(name)}"


def _field_of(model: type[BaseModel], name: str) -> str:
    field = name.replace("-", "_")
    if field not in model.model_fields:
        raise OptionError(_unknown(name, list(model.model_fields)))
    return field


def _unknown(name: str, names: Sequence[str]) -> str:
    shown = list(map(outside, names))
    hint = did_you_mean(name, shown)
    return f"unknown option {quoted(name, 80)}; {hint}there are {', '.join(shown)}"


def _written(parameter: Any) -> str:
    """Return the name that an option has on the command line, with underscores."""
    name: str = max(parameter.opts, key=len).lstrip("-").replace("-", "_")
    return name


def _take_config(context: typer.Context, path: Path | None) -> Path | None:
    """Let a file's values stand for the defaults of the command that is being read."""
    if path is not None and not context.resilient_parsing:
        defaults: Mapping[str, Any] = context.default_map or {}
        try:
            document = _said_of_command(read_document(path), context)
        except OptionError as error:
            raise typer.BadParameter(str(error)) from None
        try:
            values = values_in(document, context.command)
        except OptionError as error:
            raise typer.BadParameter(f"{printable(str(path))}: {error}") from None
        context.default_map = {**defaults, **values}
    return path


def _said_of_command(document: Mapping[str, Any], context: typer.Context) -> dict[str, Any]:
    """Return what a file says of the command that is being read: all but other commands' tables."""
    commands = getattr(context.parent and context.parent.command, "commands", {})
    tables = {
        name: value
        for name, value in document.items()
        if isinstance(value, dict) and name in commands
    }
    rest = {name: value for name, value in document.items() if name not in tables}
    return {**rest, **tables.get(context.info_name or "", {})}


_CONFIG_OPTION: Final = inspect.Parameter(
    CONFIG,
    inspect.Parameter.KEYWORD_ONLY,
    default=None,
    annotation=Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="TOML file of these options, or of the whole program with a table for each"
            " command; the command line and the environment win over it.",
            show_envvar=False,
            callback=_take_config,
            is_eager=True,
        ),
    ],
)
