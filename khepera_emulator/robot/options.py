"""Options of an emulated robot, declared once.

The command line of `khepera-emulator run`, a TOML file for its `--config`, `khepera://` URLs, the
header of a wire log and the pages of the reference follow from this model.
"""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from enum import StrEnum
from typing import Annotated, Final, Self
from urllib.parse import parse_qsl, quote, unquote, urlencode

from khepera_protocol.options import Cli, from_strings, to_strings
from khepera_protocol.registry import is_own_code
from khepera_protocol.text import printable, quoted
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SkipValidation,
    field_validator,
    model_validator,
)

from khepera_emulator.arenas.arena import MOST_ROBOTS, load_arena
from khepera_emulator.body.drift import DEFAULT_DRIFT, parse_drift
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.fault import FAULTS, split_kind
from khepera_emulator.line.fault_text import parse_faults
from khepera_emulator.models import KHEPERA, MODELS, find_model
from khepera_emulator.robot.kind import all_profiles, all_switches, choose, kind_of
from khepera_emulator.robot.setup import DEFAULT_SEED, Setup
from khepera_emulator.turrets.catalogue import TURRET_CLASSES, find_turrets

ROBOT: Final = "khepera://"
"""Beginning of the URL of an in-process robot."""

HIGHEST_SEED: Final = 10**18 - 1

_LONGEST_PAUSE: Final = 999_999.0
_FASTEST: Final = 10_000_000
"""Bits a second: more than any serial line has."""

_BAUD: Final = re.compile(r"[1-9][0-9]{0,7}", re.ASCII)

AUTO, UNPACED = "auto", "unpaced"
"""Rates of a line: that of the client, and none."""


class Physics(StrEnum):
    """Ways of moving robots."""

    AUTO = "auto"
    PYBULLET = "pybullet"


class RobotOptions(BaseModel):
    """Everything that emulated robots are made from."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    # the path of a file may hold bytes that are no text
    arena: Annotated[str, SkipValidation] = Field(
        default="corridor",
        description="Name of an arena (see `arenas`), or path of a TOML file.",
    )
    model: Annotated[str, Cli(names=MODELS.names)] = Field(
        default=KHEPERA.name,
        description="Robot: {names}; or file.py:MODEL; with --robots several, separated by commas,"
        " in turn.",
    )
    seed: int = Field(
        default=DEFAULT_SEED, ge=0, le=HIGHEST_SEED, description="Seed for all randomness."
    )
    drift: Annotated[str, Cli(metavar="SPEC")] = Field(
        default=DEFAULT_DRIFT,
        description="How far real motion differs from the encoders: none, default, strong,"
        " or items such as scale=0.01,slip=0.05.",
    )
    physics: Physics = Field(
        default=Physics.AUTO,
        description="Motion of the robots: auto, exact arithmetic, and PyBullet where something can"
        " be pushed; pybullet, rigid bodies in it all the time (see docs/physics.md).",
    )
    baud: Annotated[str, Cli(metavar="auto|unpaced|N")] = Field(
        default=AUTO,
        description="Rate of the line: auto, the one the client has set; unpaced, the line takes no"
        " time; or a number of bits a second: clients at another rate read and send garbage.",
    )
    fault: Annotated[tuple[str, ...], Cli(metavar="SPEC", names=FAULTS.names)] = Field(
        default=(),
        description="A fault of the line or of the robot, such as drop:p=0.001, cut:at=10,for=2"
        " or dead-sensor:sensor=2 (see docs/faults.md): {names}; or file.py:Class; repeatable.",
    )
    turret: Annotated[tuple[str, ...], Cli(metavar="NAME", names=TURRET_CLASSES.names)] = Field(
        default=(), description="A turret to mount: {names}; or file.py:Class; repeatable."
    )
    firmware: Annotated[tuple[str, ...], Cli(metavar="NAME[=VALUE]", names=all_switches)] = Field(
        default=(),
        description="A choice where sources differ: {names} (see docs/khepera-choices.md and"
        " docs/epuck.md); repeatable.",
    )
    profile: Annotated[str, Cli(metavar="NAME", names=all_profiles)] = Field(
        default="", description="Firmware of an e-puck: {names} (see docs/epuck.md)."
    )
    dead_man: Annotated[float | None, Cli(metavar="SECONDS")] = Field(
        default=None,
        ge=0.01,
        le=_LONGEST_PAUSE,
        description="The robot stops by itself after so long without a request; a real one rolls"
        " on.",
    )
    robots: int = Field(
        default=1,
        ge=1,
        le=MOST_ROBOTS,
        description="Number of robots in one world; names and links get a number: khepera-1,"
        " khepera-2 ...",
    )

    @field_validator("baud")
    @classmethod
    def _is_a_rate(cls, text: str) -> str:
        if text in (AUTO, UNPACED) or (_BAUD.fullmatch(text) and int(text) <= _FASTEST):
            return text
        raise ValueError(f"{quoted(text)} is no rate; give auto, unpaced, or a rate such as 38400")

    def setup(self, allowed: Collection[str] | None = None) -> Setup:
        """Read what the options name, for the first robot; see `setups`."""
        return self.setups(allowed)[0]

    def setups(self, allowed: Collection[str] | None = None) -> list[Setup]:
        """Read what the options name, for each robot.

        Args:
            allowed: parts named by a file or module that may be used, where the options come from
                elsewhere; None: all.

        Raises:
            EmulatorError: one of them names nothing that there is, or code that is not allowed.
        """
        for name in self._own_code():
            if allowed is not None and name not in allowed:
                raise EmulatorError(
                    f"it uses code of its own, {printable(name, 200)}, which runs when a robot is"
                    " made; allow that with `replay --allow` and just this name, or name a part"
                    " of an installed distribution"
                )
        models = [find_model(name) for name in self._models()]
        turrets = find_turrets(self.turret)
        kinds = [kind_of(model) for model in models]
        if turrets and not any(kind.turrets for kind in kinds):
            raise EmulatorError(f"{kinds[0].title} carry no turrets")
        choices = choose(models, self.firmware, self.profile)
        same = Setup(
            arena=load_arena(self.arena),
            drift=parse_drift(self.drift),
            seed=self.seed,
            faults=parse_faults(self.fault),
            dead_man=self.dead_man,
            rigid=self.physics is Physics.PYBULLET,
        )
        made = [
            replace(
                same,
                model=model,
                choices=chosen,
                baud=self._first_rate(kind.dialect(model, chosen).first_rate),
                turrets=turrets if kind.turrets else (),
            )
            for model, kind, chosen in zip(models, kinds, choices, strict=True)
        ]
        return [made[number % len(made)] for number in range(self.robots)]

    def _models(self) -> list[str]:
        return self.model.split(",")

    def _own_code(self) -> list[str]:
        """Return the parts that are named by a file or module."""
        faults = [split_kind(text)[0] for text in self.fault]
        return [name for name in (*self._models(), *self.turret, *faults) if is_own_code(name)]

    def _first_rate(self, usual: int) -> int | None:
        if self.baud == UNPACED:
            return None
        return usual if self.baud == AUTO else int(self.baud)


class UrlOptions(RobotOptions):
    """One robot of those that share a world, as a URL names it."""

    robot: int = Field(
        default=1, ge=1, le=MOST_ROBOTS, description="Number of the robot that this line is of."
    )

    @model_validator(mode="after")
    def _is_one_of_them(self) -> Self:
        if self.robot > self.robots:
            raise ValueError(f"robot={self.robot} is not from 1 to {self.robots}")
        return self

    @classmethod
    def of(cls, options: RobotOptions, robot: int, faults: Sequence[str] = ()) -> Self:
        """Return the options of one of several robots, with more faults on its line."""
        more = {"fault": (*options.fault, *faults), "robot": robot}
        return cls.model_validate(options.model_dump() | more)

    @classmethod
    def from_url(cls, url: str) -> Self:
        """Read `khepera://ARENA?NAME=VALUE&...`; without ARENA it is the default one.

        Raises:
            OptionError: an option is unknown, or has a value that does not fit.
        """
        arena, _, query = url.partition("://")[2].partition("?")
        name = unquote(arena, errors="surrogateescape")
        named = [("arena", name)] if name else []
        return from_strings(cls, [*named, *parse_qsl(query, keep_blank_values=True)])

    def to_url(self) -> str:
        """Return the URL; it names defaults, too, so that a log outlives a change of them."""
        hidden = {"arena"} | ({"robots", "robot"} if self.robots == 1 else set())
        pairs = [pair for pair in to_strings(self, defaults=True) if pair[0] not in hidden]
        # faults first, as in all logs
        return robot_url(self.arena, sorted(pairs, key=lambda pair: pair[0] != "fault"))


def robot_url(arena: str, options: Iterable[tuple[str, str]]) -> str:
    """Return the URL of an in-process robot; options that are empty are left out."""
    query = urlencode([(name, value) for name, value in options if value], quote_via=quote)
    return f"{ROBOT}{quote(arena, errors='surrogateescape')}" + (f"?{query}" if query else "")
