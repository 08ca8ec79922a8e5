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
from khepera_protocol.validation import problems


class OptionError(ValueError):
    """Options, or a file of them, that cannot be used; the message is one sentence."""


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
            made = [_made(model, values, _flag) for model in models]
            function(*made, **values)

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
    return _made(model, values)


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
        pairs += [(_outside(name), str(each)) for each in values]
    return pairs


def read_config(path: Path, names: Mapping[str, str]) -> dict[str, Any]:
    """Read a TOML file of options.

    Args:
        path: of the file; keys are options' names, with dashes or underscores.
        names: the field of each option by the option's name, with underscores.

    Raises:
        OptionError: it cannot be read, or names an option that there is not.
    """
    try:
        with path.open("rb") as file:
            document = parse_toml(file.read(MAX_DOCUMENT + 1))
    except OSError as error:
        raise OptionError(f"cannot read {printable(str(path))}: {error.strerror}") from None
    except DocumentError as error:
        raise OptionError(f"{printable(str(path))}: {error}") from None
    values = {}
    for key, value in document.items():
        name = key.replace("-", "_")
        if name not in names:
            raise OptionError(f"{printable(str(path))}: {_unknown(key, list(names))}")
        if isinstance(value, dict):
            raise OptionError(f"{printable(str(path))}: {key} is a value, not a table")
        values[names[name]] = value
    return values


def _made(
    model: type[_M], values: dict[str, Any], shown: Callable[[object], str] | None = None
) -> _M:
    own = {name: values.pop(name) for name in model.model_fields if name in values}
    try:
        return model.model_validate(own)
    except ValidationError as error:
        raise OptionError(problems(error, shown or _outside)) from None


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


def _outside(name: object) -> str:
    """Return what a field is called on command lines, in files and in URLs."""
    return str(name).replace("_", "-")


def _flag(name: object) -> str:
    """Return what a field is called on the command line."""
    return f"--{_outside(name)}"


def _field_of(model: type[BaseModel], name: str) -> str:
    field = name.replace("-", "_")
    if field not in model.model_fields:
        raise OptionError(_unknown(name, list(model.model_fields)))
    return field


def _unknown(name: str, names: Sequence[str]) -> str:
    shown = list(map(_outside, names))
    hint = did_you_mean(name, shown)
    return f"unknown option {quoted(name, 80)}; {hint}there are {', '.join(shown)}"


def _written(parameter: Any) -> str:
    """Return the name that an option has on the command line, with underscores."""
    name: str = max(parameter.opts, key=len).lstrip("-").replace("-", "_")
    return name


def _take_config(context: typer.Context, path: Path | None) -> Path | None:
    """Let a file's values stand for the defaults of the command that is being read."""
    if path is not None and not context.resilient_parsing:
        names = {
            _written(each): each.name
            for each in context.command.params
            if each.name not in (None, CONFIG)
        }
        defaults: Mapping[str, Any] = context.default_map or {}
        try:
            values = read_config(path, names)
        except OptionError as error:
            raise typer.BadParameter(str(error)) from None
        context.default_map = {**defaults, **values}
    return path


_CONFIG_OPTION: Final = inspect.Parameter(
    CONFIG,
    inspect.Parameter.KEYWORD_ONLY,
    default=None,
    annotation=Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="TOML file of these options; the command line wins over it.",
            show_envvar=False,
            callback=_take_config,
            is_eager=True,
        ),
    ],
)
