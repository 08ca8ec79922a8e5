"""Settings of a brain: which parts it is composed of, each with its own settings."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from inspect import Parameter, signature
from typing import Annotated, Any, Final

from khepera_protocol.mirror import Mirror, StoredMirror
from khepera_protocol.validation import problems
from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from macor_hil.errors import MacorError
from macor_hil.mind.reinforcement import Reinforcement

MOST_NODES: Final = 1000
"""Situations of the largest map."""

GIVEN: Final = frozenset({"mirror", "nodes", "commands", "features", "mirrored", "directions"})
"""Constructor parameters that a brain gives to its parts; all others are settings."""


@dataclass(frozen=True)
class Part:
    """A part by name, with its settings.

    Attributes:
        use: name in the catalogue, or `module:Class`, or `file.py:Class`.
        settings: keyword arguments of its constructor; what is missing has its default.
    """

    use: str
    settings: Mapping[str, Any] = field(default_factory=dict, hash=False)


def _memories() -> dict[str, Part]:
    return {
        "transitions": Part("transitions"),
        "graded": Part("graded"),
        "q-learning": Part("q-learning"),
        "weak-q-learning": Part("q-learning", {"gamma": 0.0}),
        "foresight": Part("foresight"),
        "places": Part("places"),
    }


@dataclass(frozen=True)
class MindSettings:
    """Everything that decides what is learned, with the paper's values where it gives them.

    Attributes:
        nodes: n, the most situations.
        eyes: what turns pictures into features.
        clusterer: what turns features into situations.
        memories: what learns, by the names that planners ask for.
        reinforcement: what commands earn.
        mirror: geometry of the camera's mirror.
    """

    nodes: Annotated[int, Field(ge=1, le=MOST_NODES)] = 50
    eyes: Part = Part("fields-and-floor")
    clusterer: Part = Part("fuzzy-art")
    memories: Annotated[Mapping[str, Part], Field(max_length=16)] = field(
        default_factory=_memories, hash=False
    )
    reinforcement: Reinforcement = field(default_factory=Reinforcement)
    mirror: StoredMirror = field(default_factory=Mirror)


def settings_model(part: Any) -> type[BaseModel]:
    """Return the model of a part's settings: its constructor's parameters that are not given to it.

    Args:
        part: a class whose constructor is annotated.

    Raises:
        MacorError: a parameter of its constructor has no annotation or no default.
    """
    fields: dict[str, Any] = {}
    for name, parameter in signature(part).parameters.items():
        if name in GIVEN or parameter.kind in (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD):
            continue
        if Parameter.empty in (parameter.annotation, parameter.default):
            raise MacorError(
                f"the parameter {name} of {part.__qualname__} needs an annotation and a default:"
                " it is a setting"
            )
        fields[name] = parameter.annotation, parameter.default
    config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, arbitrary_types_allowed=True
    )
    return create_model(f"{part.__qualname__} settings", __config__=config, **fields)


def make_part(part: Any, settings: Mapping[str, Any], given: Mapping[str, Any]) -> Any:
    """Make a part from its settings and from what a brain gives it.

    Raises:
        MacorError: a setting is unknown or out of its range; the message names it.
    """
    model = settings_model(part)
    try:
        checked = model.model_validate(dict(settings))
    except ValidationError as error:
        raise MacorError(f"settings of {part.__qualname__}: {problems(error)}") from None
    wanted = signature(part).parameters
    values = {name: getattr(checked, name) for name in model.model_fields}
    return part(**{name: given[name] for name in given if name in wanted}, **values)
