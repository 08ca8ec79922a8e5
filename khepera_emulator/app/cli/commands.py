"""The commands of `khepera-emulator`."""

import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from khepera_protocol.options import takes
from khepera_protocol.text import PrintableFormatter, printable

from khepera_emulator.app.ending import STATUS, Ending
from khepera_emulator.app.options import LineOptions, ZenohOptions
from khepera_emulator.arenas.arena import Arena, arena_names, load_arena
from khepera_emulator.arenas.arena_text import arena_text
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.wire_log import ROBOT, Recording, read_log
from khepera_emulator.models import KHEPERA, MODELS, Model, find_model
from khepera_emulator.ports.paths import check_output
from khepera_emulator.robot.options import RobotOptions
from khepera_emulator.routes.layout import Difficulty, Kind
from khepera_emulator.routes.variants import with_own_colours
from khepera_emulator.world.bullet import load_physics
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.starts import check_starts

_DIFFERENT: Final = 1

_EXAMPLES = f"""[bold]Examples[/bold]

A robot in the corridor, its terminal under a name of its own:
[cyan]khepera-emulator run --link runs/khepera[/cyan]

Talk to it from a shell:
[cyan](printf 'B\\nN\\n' >&3; head -n 2 <&3) 3<> runs/khepera[/cyan]

Without drift, ten times faster, on a line that takes no time:
[cyan]khepera-emulator run --drift none --speed 10 --baud unpaced[/cyan]

On the network of this machine, for pySerial's socket://127.0.0.1:4000:
[cyan]khepera-emulator run --tcp 127.0.0.1:4000[/cyan]

Three robots in one room, on runs/khepera-1, runs/khepera-2 and runs/khepera-3:
[cyan]khepera-emulator run --arena open-box --robots 3 --link runs/khepera[/cyan]

A second robot on the same machine, in a world of its own:
[cyan]khepera-emulator run --robot second --link runs/second --listen tcp/127.0.0.1:7449[/cyan]

[bold]Exit status[/bold]

{STATUS}
"""


app = typer.Typer(
    help="An emulated Khepera robot on a serial line.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=False,
)


class LogLevel(StrEnum):
    """How much goes to the standard error output."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@app.command(epilog=_EXAMPLES)
@takes(RobotOptions, LineOptions, ZenohOptions)
def run(
    robots: RobotOptions,
    line: LineOptions,
    zenoh: ZenohOptions,
    ctx: typer.Context,
    log_level: Annotated[LogLevel, typer.Option(help="What to log.")] = LogLevel.WARNING,
) -> None:
    """Switch a robot on, and leave it on until Ctrl-C or SIGTERM.

    Prints one line for each robot: its name, its terminal or URL, and the link to it.
    """
    handler = logging.StreamHandler()
    handler.setFormatter(PrintableFormatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logging.basicConfig(level=log_level.upper(), handlers=[handler])
    load_physics()
    from khepera_emulator.app.serving import serve

    serve(robots, line, zenoh, ctx.find_object(Ending) or Ending(), _announce)


@app.command(epilog="[cyan]khepera-emulator arenas --generate 7 --out runs/seven.toml[/cyan]")
def arenas(
    name: Annotated[
        str | None, typer.Argument(help="An arena's name, or path of a TOML file; all if absent.")
    ] = None,
    generate: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="SEED",
            help="Make one from a seed, in which 40 commands are possible without a collision.",
        ),
    ] = None,
    kind: Annotated[
        Kind | None, typer.Option(help="With --generate: what comes first.", show_default="by seed")
    ] = None,
    difficulty: Annotated[
        Difficulty | None,
        typer.Option(help="With --generate: how narrow, and how much.", show_default="by seed"),
    ] = None,
    own_colours: Annotated[
        bool, typer.Option("--own-colours", help="Give every straight wall a colour of its own.")
    ] = False,
    draw: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Picture to draw the arena into: .png, .jpg, .svg or .pdf.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="TOML file to write the arena into.")
    ] = None,
    model: Annotated[
        str,
        typer.Option(help=f"Robot that must fit: {', '.join(MODELS.names())}; or file.py:MODEL."),
    ] = KHEPERA.name,
) -> None:
    """List the arenas that come with the emulator; or check, draw, vary or make one.

    A named arena is checked as `run` checks it. What goes into no file is printed as TOML.
    """
    robot = find_model(model)
    if out is not None:
        check_output(out, (".toml",))
    if generate is None and (kind or difficulty):
        raise EmulatorError("--kind and --difficulty are for an arena that --generate makes")
    if generate is not None:
        from khepera_emulator.routes.generator import generate as make

        if name is not None:
            raise EmulatorError(
                f"--generate makes an arena of its own: leave out {printable(name)}"
            )
        arena, text = make(generate, kind, difficulty, own_colours=own_colours)
    elif not (draw or out or own_colours):
        _list_arenas(arena_names() if name is None else [name], robot)
        return
    elif name is None:
        raise EmulatorError(
            "--draw, --out and --own-colours are for one arena: name it, or give the path of its"
            " file"
        )
    else:
        arena = _checked(name, robot)
        arena = with_own_colours(arena) if own_colours else arena
        text = arena_text(arena)
    if out is not None:
        _write(out, text)
    if draw is not None:
        from khepera_emulator.app.arena_picture import draw_arena

        draw_arena(arena, draw, robot)
    if not (out or draw):
        typer.echo(text, nl=False)


@app.command()
def replay(
    file: Annotated[Path, typer.Argument(help="A wire log, as `run --record` writes it.")],
    port: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Any pySerial port with a robot just switched on, such as /dev/ttyUSB0;"
            " without it an emulated robot like the recorded one, in virtual time.",
        ),
    ] = None,
    ignore: Annotated[
        str,
        typer.Option(
            metavar="LETTERS",
            help="Requests whose replies may have other values, such as N,O,E,H.",
        ),
    ] = "",
    allow: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE.py:CLASS",
            help="Code of its own, as a turret, that the log's robot may use; repeatable.",
        ),
    ] = None,
) -> None:
    """Play the requests of a wire log at their times, and compare the replies.

    Exit status: 0 if all are equal, 1 at the first difference, which is printed, 2 if the log is
    damaged: what stands before the damage is replayed all the same.
    """
    from khepera_emulator.app.replay import Difference
    from khepera_emulator.app.replay import replay as play

    recording = read_log(file)
    url = port or _recorded_robot(file, recording)
    try:
        with _line(url, allow or []) as line, _stopping(line):
            result = play(recording, line, [word.strip() for word in ignore.split(",")])
    except (OSError, ValueError) as error:
        raise EmulatorError(f"cannot replay on {url}: {error}") from None
    if isinstance(result, Difference):
        typer.echo(str(result))
        raise typer.Exit(_DIFFERENT)
    typer.echo(f"{result} reply lines equal")
    if recording.damage:
        raise EmulatorError(f"{recording.damage}; only what stands before was replayed")


def _line(url: str, allowed: list[str]) -> Any:
    """Return a port that is not open yet; the robot of a log runs code that is allowed alone."""
    import serial

    import khepera_emulator  # noqa: F401 - registers khepera://

    line = serial.serial_for_url(url, timeout=1.0, do_not_open=True)
    if hasattr(line, "allowed"):
        line.allowed = allowed
    return line


@contextmanager
def _stopping(line: Any) -> Iterator[None]:
    """Leave a standing robot, whatever ends the replay; one in this process ends with it."""
    try:
        yield
    finally:
        if not hasattr(line, "emulator"):
            with suppress(OSError):  # the port has failed
                line.write(b"\nD,0,0\n")
                line.flush()


def _checked(name: str, model: Model) -> Arena:
    """An arena in which robots of a model can start."""
    arena = load_arena(name)
    try:
        check_starts(arena, model)
    except EmulatorError as error:
        raise EmulatorError(f"the arena {name!r}: {error}") from None
    return arena


def _recorded_robot(file: Path, recording: Recording) -> str:
    """The robot that a log names. A file may name an emulated one, and no device or file."""
    if not recording.url.startswith(ROBOT):
        raise EmulatorError(
            f"{file} names {recording.url[:100]!r} as its robot, which is no emulated one"
            f" ({ROBOT}...); give --port to replay it on a port of your own"
        )
    return recording.url


def _list_arenas(names: list[str], model: Model) -> None:
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


def _announce(line: str) -> None:
    """Print a line; where nobody reads it, the robot lives on."""
    try:
        typer.echo(printable(line))
    except OSError:
        # what could not be written would be tried again at the end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
