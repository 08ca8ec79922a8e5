"""Options that a controller is composed by: eyes, a clusterer, memories, and planners.

A part is a name in its registry, a class of an installed module (`package.module:Class`), or one
of a file (`my_file.py:Mine`). Settings of parts are given as PART.SETTING=VALUE, where PART is
eyes, clusterer, planner or the name of a memory, and VALUE is JSON or a word.
"""

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Final

from khepera_protocol.mirror import Mirror
from khepera_protocol.options import Cli
from khepera_protocol.registry import Registry, RegistryError, is_own_code
from khepera_protocol.text import printable, quoted
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator
from pydantic_core import from_json

from macor_hil.errors import MacorError
from macor_hil.mind.catalogue import CLUSTERERS, EYES, MEMORIES, PLANNERS, make_planner
from macor_hil.mind.planners.planner import Planner
from macor_hil.mind.settings import MOST_NODES, MindSettings, Part

_DEFAULT: Final = MindSettings()
_SET: Final = Cli(flags=("--set",), metavar="PART.SETTING=VALUE")
_EXAMPLE: Final = "such as clusterer.vigilance=0.9"
_PLANNER: Final = "planner"


class PartSettings(BaseModel):
    """Settings of parts, whichever the parts are."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    settings: Annotated[tuple[str, ...], _SET] = Field(
        default=(), description=f"A setting of a part, {_EXAMPLE}."
    )

    @field_validator("settings")
    @classmethod
    def _has_a_form(cls, settings: tuple[str, ...]) -> tuple[str, ...]:
        for each in settings:
            name, equals, _ = each.partition("=")
            if not (equals and all(name.partition("."))):
                raise ValueError(f"{quoted(each, 80)} is not PART.SETTING=VALUE")
        return settings

    def make_planners(self, names: Iterable[str]) -> list[Planner]:
        """Make planners; every setting must be one of theirs.

        Raises:
            MacorError: there is no such planner, or a setting is wrong.
        """
        given = self.of_parts()
        settings = given.pop(_PLANNER, {})
        _refuse(given, [_PLANNER])
        return [make_planner(name, **settings) for name in names]

    def of_parts(self) -> dict[str, dict[str, Any]]:
        """Return the settings of each part that has any."""
        parts: dict[str, dict[str, Any]] = {}
        for each in self.settings:
            name, _, text = each.partition("=")
            part, _, setting = name.rpartition(".")
            parts.setdefault(part, {})[setting] = _value(text)
        return parts


def known(name: str, parts: Registry) -> str:
    """Return the name of a part that there is; nothing is imported.

    Raises:
        ValueError: there is none.
    """
    try:
        parts.where(name)
    except RegistryError as error:
        raise ValueError(str(error)) from None
    return name


def _known_planners(names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(known(name, PLANNERS) for name in names)


PlannerNames = Annotated[tuple[str, ...], AfterValidator(_known_planners)]
"""Several planners."""


class PlannerOptions(PartSettings):
    """One planner."""

    planner: Annotated[str, Cli(names=PLANNERS.names)] = Field(
        default="anticipative",
        description="How to choose commands: {names}; or module:Class, file.py:Class.",
    )

    @field_validator("planner")
    @classmethod
    def _is_a_planner(cls, planner: str) -> str:
        return known(planner, PLANNERS)

    def make_planner(self) -> Planner:
        """Make the planner with its settings.

        Raises:
            MacorError: there is no such planner, or a setting is wrong.
        """
        return self.make_planners([self.planner])[0]


class AllowOptions(BaseModel):
    """Code of one's own that a map may use."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    allow: Annotated[tuple[str, ...], Cli(metavar="PART")] = Field(
        default=(),
        description="A part, module:Class or file.py:Class, whose code may run when the map names"
        " it.",
    )


class MindOptions(PartSettings):
    """Parts of a new controller."""

    nodes: int = Field(
        default=_DEFAULT.nodes, ge=1, le=MOST_NODES, description="Most situations there can be."
    )
    eyes: Annotated[str, Cli(names=EYES.names)] = Field(
        default=_DEFAULT.eyes.use,
        description="Turns pictures into features: {names}; or a class.",
    )
    clusterer: Annotated[str, Cli(names=CLUSTERERS.names)] = Field(
        default=_DEFAULT.clusterer.use,
        description="Turns features into situations: {names}; or a class.",
    )
    memory: Annotated[
        tuple[str, ...],
        Cli(metavar="NAME[=PART]", names=MEMORIES.names, show_default="those of all planners"),
    ] = Field(default=(), description="A memory that learns: {names}.")
    planner: Annotated[PlannerNames, Cli(names=PLANNERS.names)] = Field(
        default=(), description="Learn the memory that this planner reads, and no others: {names}."
    )

    @field_validator("eyes")
    @classmethod
    def _are_eyes(cls, eyes: str) -> str:
        return known(eyes, EYES)

    @field_validator("clusterer")
    @classmethod
    def _is_a_clusterer(cls, clusterer: str) -> str:
        return known(clusterer, CLUSTERERS)

    @field_validator("memory")
    @classmethod
    def _are_memories(cls, memories: tuple[str, ...]) -> tuple[str, ...]:
        for each in memories:
            known(_memory(each)[1].use, MEMORIES)
        return memories

    def mind_settings(self, mirror: Mirror | None = None) -> MindSettings:
        """Return the settings of the brain that is composed.

        Args:
            mirror: of the camera; None: the usual one.

        Raises:
            MacorError: a planner or a memory is not there, or a setting belongs to no part.
        """
        given = self.of_parts()
        memories = self._memories(given.pop(_PLANNER, {}) if self.planner else {})
        settings = MindSettings(
            self.nodes,
            Part(self.eyes, given.pop("eyes", {})),
            Part(self.clusterer, given.pop("clusterer", {})),
            {
                name: Part(part.use, {**part.settings, **given.pop(name, {})})
                for name, part in memories.items()
            },
            mirror=mirror or _DEFAULT.mirror,
        )
        _refuse(given, ["eyes", "clusterer", *memories, *([_PLANNER] if self.planner else [])])
        return settings

    def _memories(self, settings: Mapping[str, Any]) -> Mapping[str, Part]:
        """Return the memories that are asked for, and those that the planners read."""
        memories = dict(map(_memory, self.memory))
        for name in self.planner:
            memory = make_planner(name, **settings).memory
            if memory not in memories:
                memories |= [_memory_of(name, memory)]
        return memories or _DEFAULT.memories


def _refuse(given: Mapping[str, Any], known: Iterable[str]) -> None:
    """Refuse settings of parts that there are not."""
    for part in given:
        raise MacorError(
            f"--set {printable(part, 80)}: there is no such part here; there are {', '.join(known)}"
        )


def _memory(text: str) -> tuple[str, Part]:
    """Parse NAME or NAME=PART.

    Raises:
        ValueError: it is neither.
    """
    name, equals, use = text.partition("=")
    if equals and name and use:
        return name, Part(use)
    if name in _DEFAULT.memories:
        return name, _DEFAULT.memories[name]
    if equals or is_own_code(name):
        raise ValueError(
            f"{quoted(text, 80)} is not NAME=PART, where NAME is what planners ask for"
        )
    return name, Part(name)


def _memory_of(planner: str, memory: str) -> tuple[str, Part]:
    try:
        return _memory(memory)
    except ValueError as error:
        raise MacorError(f"the memory of --planner {printable(planner, 80)}: {error}") from None


def _value(text: str) -> Any:
    try:
        return from_json(text.encode(), allow_inf_nan=False)
    except ValueError:  # or bytes that are no text
        return text
