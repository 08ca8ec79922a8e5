"""`khepera-emulator arenas`: list, check, draw, vary or make arenas."""

from pathlib import Path
from typing import Annotated

import typer
from khepera_protocol.options import Cli
from khepera_protocol.text import printable
from pydantic import BaseModel, Field, SkipValidation

from khepera_emulator.arenas.arena import Arena, arena_names, load_arena
from khepera_emulator.arenas.arena_text import arena_text
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import KHEPERA, MODELS, Model, find_model
from khepera_emulator.ports.paths import check_output
from khepera_emulator.routes.layout import Difficulty, Kind
from khepera_emulator.routes.variants import with_own_colours
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.starts import check_starts


class ArenaOptions(BaseModel):
    """An arena, and what to do with it."""

    # the path of a file may hold bytes that are no text
    name: Annotated[str | None, SkipValidation, Cli(argument=True)] = Field(
        default=None, description="An arena's name, or path of a TOML file; all if absent."
    )
    generate: Annotated[int | None, Cli(metavar="SEED")] = Field(
        default=None,
        ge=0,
        description="Make one from a seed, in which 40 commands are possible without a collision.",
    )
    kind: Annotated[Kind | None, Cli(show_default="by seed")] = Field(
        default=None, description="With --generate: what comes first."
    )
    difficulty: Annotated[Difficulty | None, Cli(show_default="by seed")] = Field(
        default=None, description="With --generate: how narrow, and how much."
    )
    own_colours: Annotated[bool, Cli(flags=("--own-colours",))] = Field(
        default=False, description="Give every straight wall a colour of its own."
    )
    draw: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None, description="Picture to draw the arena into: .png, .jpg, .svg or .pdf."
    )
    out: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None, description="TOML file to write the arena into."
    )
    model: Annotated[str, Cli(names=MODELS.names)] = Field(
        default=KHEPERA.name, description="Robot that must fit: {names}; or file.py:MODEL."
    )

    @property
    def lists(self) -> bool:
        """True if nothing is to be done but to list arenas."""
        return self.generate is None and not (self.draw or self.out or self.own_colours)


def arenas(options: ArenaOptions) -> None:
    """List the arenas that come with the emulator; or check, draw, vary or make one.

    A named arena is checked as `run` checks it. What goes into no file is printed as TOML.
    """
    robot = find_model(options.model)
    if options.out is not None:
        check_output(options.out, (".toml",))
    if options.generate is None and (options.kind or options.difficulty):
        raise EmulatorError("--kind and --difficulty are for an arena that --generate makes")
    if options.lists:
        _list(arena_names() if options.name is None else [options.name], robot)
        return
    arena, text = _generated(options) if options.generate is not None else _named(options, robot)
    if options.out is not None:
        _write(options.out, text)
    if options.draw is not None:
        from khepera_emulator.app.arena_picture import draw_arena

        draw_arena(arena, options.draw, robot)
    if not (options.out or options.draw):
        typer.echo(text, nl=False)


def _generated(options: ArenaOptions) -> tuple[Arena, str]:
    """Make an arena from a seed; return it, and its file's text."""
    from khepera_emulator.routes.generator import generate

    if options.name is not None:
        raise EmulatorError(
            f"--generate makes an arena of its own: leave out {printable(options.name)}"
        )
    assert options.generate is not None
    return generate(
        options.generate, options.kind, options.difficulty, own_colours=options.own_colours
    )


def _named(options: ArenaOptions, robot: Model) -> tuple[Arena, str]:
    """Read an arena, and vary it if need be; return it, and its file's text."""
    if options.name is None:
        raise EmulatorError(
            "--draw, --out and --own-colours are for one arena: name it, or give the path of its"
            " file"
        )
    arena = _checked(options.name, robot)
    if options.own_colours:
        arena = with_own_colours(arena)
    return arena, arena_text(arena)


def _checked(name: str, model: Model) -> Arena:
    """Read an arena in which robots of a model can start."""
    arena = load_arena(name)
    try:
        check_starts(arena, model)
    except EmulatorError as error:
        raise EmulatorError(f"the arena {name!r}: {error}") from None
    return arena


def _list(names: list[str], model: Model) -> None:
    width = max(map(len, names))
    for each in names:
        arena = _checked(each, model)
        (x0, y0), (x1, y1) = FloorPlan(arena).bounds()
        typer.echo(f"{printable(each):{width}}  {x1 - x0:.2f} x {y1 - y0:.2f} m  {arena.title}")


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise EmulatorError(f"cannot write {path}: {error.strerror}") from None
