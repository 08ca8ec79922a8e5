"""Arenas as validated data files: walls, posts, lamps and movable objects on a flat floor.

An arena is a TOML file; lengths are metres, angles degrees. The ones that come with the package
lie in `khepera_emulator/arenas`; a path to a file of one's own works in every place where a
name does. Everything in it has bounds, in size and in number: what passes can be simulated.
"""

from importlib import resources
from itertools import pairwise
from math import hypot
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from khepera_protocol.text import MAX_DOCUMENT, DocumentError, did_you_mean, parse_toml, printable
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from khepera_emulator.arenas.mistakes import describe
from khepera_emulator.errors import EmulatorError

MOST_ROBOTS: Final = 32
"""Robots in one world; one process steps them all."""

FARTHEST: Final = 10.0
"""Metres from the origin, along each axis, within which everything stands."""

MOST_SOLIDS: Final = 2000
"""Stretches of walls, posts and things: a picture of so many takes two tenths of a second."""

MOST_THINGS: Final = 100
"""Things to push, which are stepped 200 times a second."""

MOST_LAMPS: Final = 100

MOST_PAINTS: Final = 100

_SHORTEST: Final = 0.001
"""Metres of the shortest stretch, and of the least size of anything."""

Number = Annotated[float, Field(strict=True)]
"""A number in the file: no text, no truth value."""

Metres = Annotated[Number, Field(ge=-FARTHEST, le=FARTHEST)]
Degrees = Annotated[Number, Field(ge=-360.0, le=360.0, description="degrees")]
Point = tuple[Metres, Metres]
Side = Annotated[Number, Field(ge=0.005, le=1.0)]
Share = Annotated[Number, Field(ge=0.0, le=1.0)]
Colour = tuple[Share, Share, Share]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def _check_stretches(points: list[Point]) -> None:
    for start, end in pairwise(points):
        if start == end:
            raise ValueError(f"two points in a row are the same: {start}")
        if hypot(end[0] - start[0], end[1] - start[1]) < _SHORTEST:
            raise ValueError(f"two points in a row are less than 1 mm apart: {start} and {end}")


class Wall(_Part):
    """A wall along a polyline of its foot points; its faces lie half a thickness beside it."""

    points: list[Point] = Field(min_length=2, max_length=MOST_SOLIDS)
    colour: Colour = (1.0, 1.0, 1.0)
    height: Number = Field(default=0.10, ge=_SHORTEST, le=2.0)
    thickness: Number = Field(default=0.01, ge=_SHORTEST, le=1.0)

    @model_validator(mode="after")
    def _has_length(self) -> Self:
        _check_stretches(self.points)
        return self


class Cylinder(_Part):
    """An upright round post."""

    centre: Point
    radius: Number = Field(ge=_SHORTEST, le=1.0)
    height: Number = Field(default=0.10, ge=_SHORTEST, le=2.0)
    colour: Colour = (1.0, 1.0, 1.0)


class Lamp(_Part):
    """A light bulb that hangs above the robots, as bright as 50 W times `power`.

    Its light is reckoned in the plane of the sensors; walls, posts and bodies stop it.
    """

    centre: Point
    power: Number = Field(default=1.0, ge=0.001, le=10.0)


class Paint(_Part):
    """A stripe painted on the floor along a polyline, its ends round; later ones lie on top.

    Ground sensors see it. Cameras do not.
    """

    points: list[Point] = Field(min_length=2, max_length=MOST_SOLIDS)
    width: Number = Field(default=0.02, ge=_SHORTEST, le=5.0)
    colour: Colour = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _has_length(self) -> Self:
        _check_stretches(self.points)
        return self


class Movable(_Part):
    """A thing that robots push. It slides upright, held by friction; a ball rolls.

    A post and a ball have a radius, a box a size (length and width). A ball is as high as wide.
    """

    shape: Literal["post", "ball", "box"]
    centre: Point
    heading: Degrees = 0.0
    radius: Number | None = Field(default=None, ge=0.004, le=0.5)
    size: tuple[Side, Side] | None = None
    height: Number = Field(default=0.04, ge=0.01, le=1.0)
    mass: Number = Field(default=0.02, description="kilograms", ge=0.001, le=5.0)
    friction: Number = Field(
        default=0.4, description="with the floor; of a ball: a twentieth of it", ge=0.001, le=2.0
    )
    resistivity: int = Field(
        default=128, description="as a gripper reads it", strict=True, ge=1, le=255
    )
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
    """Place of a robot after power-on."""

    x: Metres
    y: Metres
    heading: Degrees = 0.0


class Corridor(_Part):
    """Strip of `random` starts: along a middle line, to its sides, about its heading."""

    points: list[Point] = Field(min_length=2, max_length=MOST_SOLIDS)
    half_width: Number = Field(ge=_SHORTEST, le=5.0)
    heading_spread: Number = Field(default=180.0, description="degrees", gt=0.0, le=180.0)
    gap: Number = Field(
        default=0.03, description="least distance of the body to anything", ge=0.0, le=5.0
    )

    @model_validator(mode="after")
    def _has_length(self) -> Self:
        _check_stretches(self.points)
        return self


class Arena(_Part):
    """Everything that stands around a robot."""

    version: int = Field(strict=True, ge=1, le=1)
    title: Annotated[str, AfterValidator(printable)] = Field(max_length=200)
    floor: Colour = (0.5, 0.5, 0.5)
    sky: Colour = (1.0, 1.0, 1.0)
    start: Start
    free: Corridor
    paint: list[Paint] = Field(default_factory=list, max_length=MOST_PAINTS)
    wall: list[Wall] = Field(default_factory=list, max_length=MOST_SOLIDS)
    cylinder: list[Cylinder] = Field(default_factory=list, max_length=MOST_SOLIDS)
    lamp: list[Lamp] = Field(default_factory=list, max_length=MOST_LAMPS)
    object: list[Movable] = Field(default_factory=list, max_length=MOST_THINGS)
    starts: list[Start] = Field(
        default_factory=list,
        description="of the robots after the first; drawn if absent",
        max_length=MOST_ROBOTS - 1,
    )

    @model_validator(mode="after")
    def _is_bounded(self) -> Self:
        stretches = sum(len(wall.points) - 1 for wall in self.wall)
        posts, things = len(self.cylinder), len(self.object)
        if stretches + posts + things > MOST_SOLIDS:
            raise ValueError(
                f"there are {stretches} stretches of walls, {posts} posts and {things} things, and"
                f" {MOST_SOLIDS} of all are the most"
            )
        return self


def arena_names() -> list[str]:
    """Return names of the arenas that come with the package."""
    folder = resources.files("khepera_emulator") / "arenas"
    return sorted(
        entry.name.removesuffix(".toml")
        for entry in folder.iterdir()
        if entry.name.endswith(".toml")
    )


def load_arena(name: str) -> Arena:
    """Return the arena of a name, or of a path to a TOML file.

    Raises:
        EmulatorError: there is no such arena, or its file does not hold one.
    """
    try:
        return Arena.model_validate(parse_toml(_document(name)))
    except DocumentError as error:
        raise EmulatorError(f"the arena {name!r} is not TOML: {error}") from None
    except ValidationError as error:
        raise EmulatorError(f"the arena {name!r}: {describe(error, Arena)}") from None


def _document(name: str) -> bytes:
    """Return the bytes of an arena's file, or a few more than are ever parsed."""
    names = arena_names()
    if name in names:
        return (resources.files("khepera_emulator") / "arenas" / f"{name}.toml").read_bytes()
    path = Path(name)
    try:
        if not name or (path.name == name and not path.suffix and not path.exists()):
            raise EmulatorError(_unknown(name, names))
        if path.exists() and not path.is_file():
            # a pipe or a device might never end
            raise EmulatorError(f"the arena {name!r} is not a file; give the path of a TOML file")
        with path.open("rb") as file:
            data = file.read(MAX_DOCUMENT + 1)
    except OSError as error:
        raise EmulatorError(f"cannot read the arena {name!r}: {error.strerror}") from None
    except ValueError:  # a NUL in the name
        raise EmulatorError(_unknown(name, names)) from None
    if len(data) > MAX_DOCUMENT:
        raise EmulatorError(f"the arena {name!r} has more than {MAX_DOCUMENT:,} bytes")
    return data


def _unknown(name: str, names: list[str]) -> str:
    hint = did_you_mean(name, names) + "there"
    return f"unknown arena {name!r}: {hint} are {', '.join(names)}; or give the path of a TOML file"
