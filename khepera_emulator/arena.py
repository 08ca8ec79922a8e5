"""Arenas as validated data files: walls, posts, lamps and movable objects on a flat floor.

An arena is a TOML file; lengths are metres, angles degrees. The ones that come with the package
lie in `khepera_emulator/arenas`; a path to a file of one's own works in every place where a
name does.
"""

import tomllib
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from khepera_emulator.errors import EmulatorError

MOST_ROBOTS: Final = 32
"""Robots in one world; one process steps them all."""

Metres = Annotated[float, Field(ge=-10.0, le=10.0)]
Point = tuple[Metres, Metres]
Side = Annotated[float, Field(ge=0.005, le=1.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Colour = tuple[Share, Share, Share]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def _check_stretches(points: list[Point]) -> None:
    for start, end in pairwise(points):
        if start == end:
            raise ValueError(f"two points in a row are the same: {start}")


class Wall(_Part):
    """A wall along a polyline of its foot points; its faces lie half a thickness beside it."""

    points: list[Point] = Field(min_length=2)
    colour: Colour = (1.0, 1.0, 1.0)
    height: float = Field(default=0.10, gt=0.0, le=2.0)
    thickness: float = Field(default=0.01, ge=0.001, le=1.0)

    @model_validator(mode="after")
    def _has_length(self) -> Self:
        _check_stretches(self.points)
        return self


class Cylinder(_Part):
    """An upright round post."""

    centre: Point
    radius: float = Field(gt=0.0, le=1.0)
    height: float = Field(default=0.10, gt=0.0, le=2.0)
    colour: Colour = (1.0, 1.0, 1.0)


class Lamp(_Part):
    """A light bulb that hangs above the robots, as bright as 50 W times `power`.

    Its light is reckoned in the plane of the sensors; walls, posts and bodies stop it.
    """

    centre: Point
    power: float = Field(default=1.0, gt=0.0, le=10.0)


class Movable(_Part):
    """A thing that robots push. It slides upright, held by friction; a ball rolls.

    A post and a ball have a radius, a box a size (length and width). A ball is as high as wide.
    """

    shape: Literal["post", "ball", "box"]
    centre: Point
    heading: float = Field(default=0.0, description="degrees", ge=-360.0, le=360.0)
    radius: float | None = Field(default=None, ge=0.004, le=0.5)
    size: tuple[Side, Side] | None = None
    height: float = Field(default=0.04, ge=0.01, le=1.0)
    mass: float = Field(default=0.02, description="kilograms", ge=0.001, le=5.0)
    friction: float = Field(
        default=0.4, description="with the floor; of a ball: a twentieth of it", gt=0.0, le=2.0
    )
    resistivity: int = Field(default=128, description="as a gripper reads it", ge=1, le=255)
    colour: Colour = (1.0, 1.0, 1.0)

    @model_validator(mode="after")
    def _has_one_measure(self) -> Self:
        if self.shape == "box":
            if self.size is None or self.radius is not None:
                raise ValueError("a box has a size, [length, width], and no radius")
        elif self.radius is None or self.size is not None:
            raise ValueError(f"a {self.shape} has a radius and no size")
        return self


class Start(_Part):
    """Where a robot stands after power-on."""

    x: Metres
    y: Metres
    heading: float = Field(default=0.0, description="degrees", ge=-360.0, le=360.0)


class Corridor(_Part):
    """Where `random` starts are drawn: along a middle line, to its sides, about its heading."""

    points: list[Point] = Field(min_length=2)
    half_width: float = Field(gt=0.0, le=5.0)
    heading_spread: float = Field(default=180.0, description="degrees", gt=0.0, le=180.0)
    gap: float = Field(default=0.03, description="least distance of the body to anything", ge=0.0)

    @model_validator(mode="after")
    def _has_length(self) -> Self:
        _check_stretches(self.points)
        return self


class Arena(_Part):
    """Everything that stands around a robot."""

    version: int = Field(ge=1, le=1)
    title: str
    floor: Colour = (0.5, 0.5, 0.5)
    sky: Colour = (1.0, 1.0, 1.0)
    start: Start
    free: Corridor
    wall: list[Wall] = Field(default_factory=list)
    cylinder: list[Cylinder] = Field(default_factory=list)
    lamp: list[Lamp] = Field(default_factory=list)
    object: list[Movable] = Field(default_factory=list)
    starts: list[Start] = Field(
        default_factory=list, description="of the robots after the first; drawn if absent"
    )


def arena_names() -> list[str]:
    """Names of the arenas that come with the package."""
    folder = resources.files("khepera_emulator") / "arenas"
    return sorted(
        entry.name.removesuffix(".toml")
        for entry in folder.iterdir()
        if entry.name.endswith(".toml")
    )


def load_arena(name: str) -> Arena:
    """The arena of a name, or of a path to a TOML file.

    Raises:
        EmulatorError: there is no such arena, or its file does not hold one.
    """
    if name in arena_names():
        text = (resources.files("khepera_emulator") / "arenas" / f"{name}.toml").read_text("utf-8")
    else:
        try:
            text = Path(name).read_text("utf-8")
        except (OSError, ValueError):  # ValueError: not UTF-8, or a NUL in the name
            raise EmulatorError(
                f"unknown arena {name!r}: neither one of {', '.join(arena_names())}"
                " nor a readable TOML file"
            ) from None
    try:
        return Arena.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise EmulatorError(f"arena {name!r} is not TOML: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "the file"
        raise EmulatorError(f"arena {name!r}: {place}: {first['msg']}") from None
