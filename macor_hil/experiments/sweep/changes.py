"""Experiments with other settings than their own: quick ones, in another arena, or one by one.

A setting is named by its place in the settings dataclass: `nodes`, `drive.random`, `course.trials`,
`drive.brain.clusterer.settings.vigilance`. Its value is JSON, or a word. What comes out is checked
by the types of the dataclass.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, Final

from khepera_protocol.text import did_you_mean, printable, quoted
from khepera_protocol.validation import problems
from pydantic import TypeAdapter, ValidationError
from pydantic_core import from_json

from macor_hil.errors import MacorError
from macor_hil.experiments.drives.arena_files import arena_for_port
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.results.store import plain

_ARENA: Final = "arena"
_OWN_ARENAS: Final = "homes"
"""Setting of experiments that have many arenas, and not one."""


def quick(experiments: Iterable[Experiment]) -> tuple[Experiment, ...]:
    """Return experiments with settings that take minutes.

    Raises:
        MacorError: one of them has none.
    """
    experiments = tuple(experiments)
    if without := [each.name for each in experiments if each.quick is None]:
        raise MacorError(f"there is no quick form of {', '.join(without)}")
    return tuple(replace(experiment, settings=experiment.quick) for experiment in experiments)


def in_arena(experiments: Sequence[Experiment], arena: str) -> tuple[Experiment, ...]:
    """Return experiments whose drives and trials in the arena of training are in another one.

    Experiments that have many arenas stay as they are.

    Args:
        experiments: what to change.
        arena: one that comes with the emulator, or the path of a file.

    Raises:
        MacorError: there is no such arena, or none of the experiments has one arena.
    """
    place = arena_for_port(arena)
    if all(hasattr(each.settings, _OWN_ARENAS) for each in experiments):
        names = ", ".join(each.name for each in experiments)
        raise MacorError(
            f"--arena: {names} has arenas of its own; name others with"
            f' --set {_OWN_ARENAS}=\'[{{"arena": "maze"}}]\''
        )
    return tuple(
        each if hasattr(each.settings, _OWN_ARENAS) else _moved(each, place) for each in experiments
    )


def with_settings(
    experiments: Sequence[Experiment], given: Iterable[str]
) -> tuple[Experiment, ...]:
    """Return experiments with other settings.

    Args:
        experiments: what to change; each takes those settings that it has.
        given: settings as NAME=VALUE.

    Raises:
        MacorError: none of the experiments has such a setting, or a value does not fit.
    """
    changed = tuple(experiments)
    for text in given:
        name, equals, value = text.partition("=")
        if not (name and equals):
            raise MacorError(f"--set: {quoted(text, 80)} is not NAME=VALUE")
        path = name.split(".")
        has = [_missing(each.settings, path) is None for each in changed]
        if not any(has):
            raise MacorError(f"--set {printable(name, 80)}: {_unknown(changed, path)}")
        changed = tuple(
            _with(each, name, path, _value(value)) if able else each
            for each, able in zip(changed, has, strict=True)
        )
    return changed


def _with(experiment: Experiment, name: str, path: list[str], value: Any) -> Experiment:
    data = plain(experiment.settings)
    group = data
    for part in path[:-1]:
        group = group[part]
    group[path[-1]] = value
    return _checked(experiment, data, f"--set {printable(name, 80)}")


def _moved(experiment: Experiment, arena: str) -> Experiment:
    old = experiment.settings.drive.arena

    def moved(value: Any) -> Any:
        if isinstance(value, list):
            parts = [moved(each) for each in value]
            # what was an arena beside that of the training may be the same one now
            return [each for k, each in enumerate(parts) if not _again(each, parts[:k])]
        if not isinstance(value, dict):
            return value
        here = {name: moved(part) for name, part in value.items()}
        return here | {_ARENA: arena} if here.get(_ARENA) == old else here

    return _checked(experiment, moved(plain(experiment.settings)), f"--arena {arena}")


def _again(value: Any, before: list[Any]) -> bool:
    """Return whether a list of courses has one of the same place already."""
    if not (isinstance(value, dict) and _ARENA in value):
        return False
    place = value[_ARENA], value.get("anywhere")
    return any((each[_ARENA], each.get("anywhere")) == place for each in before)


def _checked(experiment: Experiment, data: Any, what: str) -> Experiment:
    try:
        settings = TypeAdapter(type(experiment.settings)).validate_python(data)
    except ValidationError as error:
        raise MacorError(f"{what}: {problems(error)}") from None
    return replace(experiment, settings=settings)


def _missing(settings: Any, path: list[str]) -> tuple[str, list[str]] | None:
    """Return the first part of a name that is no setting, and those there are; None: it is one."""
    group = settings
    for part in path:
        if isinstance(group, Mapping):
            group = group.get(part)
            continue
        known = [each.name for each in fields(group)] if is_dataclass(group) else []
        if part not in known:
            return part, known
        group = getattr(group, part)
    return None


def _unknown(experiments: Sequence[Experiment], path: list[str]) -> str:
    """Return a sentence on a setting that none of the experiments has."""
    known: dict[str, None] = {}
    for each in experiments:
        missing = _missing(each.settings, path)
        assert missing is not None
        before = path[: path.index(missing[0])]
        known |= dict.fromkeys(".".join([*before, name]) for name in missing[1])
    names = list(known)
    return (
        f"there is no such setting; {did_you_mean('.'.join(path), names)}"
        f"there {'are ' + ', '.join(names) if names else 'are none below it'}"
    )


def _value(text: str) -> Any:
    try:
        return from_json(text.encode(), allow_inf_nan=False)
    except ValueError:  # or bytes that are no text
        return text
