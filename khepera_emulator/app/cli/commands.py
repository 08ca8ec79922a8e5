"""The commands of `khepera-emulator`."""

import logging
import os
import re
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from enum import StrEnum
from itertools import zip_longest
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from khepera_protocol.serial.turrets import TURRETS
from khepera_protocol.text import PrintableFormatter, printable, quoted
from khepera_protocol.zenoh.payloads import DEFAULT_ENDPOINT

from khepera_emulator.app.cli.ending import STATUS, Ending
from khepera_emulator.arenas.arena import MOST_ROBOTS, Arena, arena_names, load_arena
from khepera_emulator.arenas.arena_text import arena_text
from khepera_emulator.body.drift import parse_drift
from khepera_emulator.choices import option_names, parse_choices
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.clock import Clock
from khepera_emulator.line.faults import MAX_SCRIPT, parse_faults, script_specs
from khepera_emulator.line.wire_log import ROBOT, Recording, WireLog, read_log, robot_url
from khepera_emulator.models import KHEPERA, MODELS, Model, find_model
from khepera_emulator.paths import check_name, check_output
from khepera_emulator.ports.link import Link
from khepera_emulator.ports.opening import open_port
from khepera_emulator.ports.terminal import FIRST_RATE
from khepera_emulator.routes.layout import Difficulty, Kind
from khepera_emulator.routes.variants import with_own_colours
from khepera_emulator.world.bullet import load_physics
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.starts import check_starts

_DIFFERENT: Final = 1
_ROBOT = re.compile(r"[A-Za-z0-9_.-]{1,64}")
_BAUD = re.compile(r"[1-9][0-9]{1,6}")

_HIGHEST_SEED: Final = 10**18 - 1
"""As in a `khepera://` URL, which stands in every recording."""

_LONGEST_PAUSE: Final = 999_999.0

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


def _finite(number: float | None) -> float | None:
    """Refuse what is no number: it is neither above nor below any bound."""
    if number is not None and not isfinite(number):
        raise typer.BadParameter("give a finite number")
    return number


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
def run(
    ctx: typer.Context,
    arena: Annotated[
        str, typer.Option(help="Name of an arena (see `arenas`), or path of a TOML file.")
    ] = "corridor",
    model: Annotated[str, typer.Option(help=f"Robot: {' or '.join(MODELS)}.")] = KHEPERA.name,
    seed: Annotated[int, typer.Option(min=0, max=_HIGHEST_SEED, help="Of all randomness.")] = 0,
    drift: Annotated[
        str,
        typer.Option(
            metavar="SPEC",
            help="How far the wheels deceive the encoders: none, default, strong,"
            " or items such as scale=0.01,slip=0.05.",
        ),
    ] = "default",
    speed: Annotated[
        float,
        typer.Option(
            min=0.01, max=1000.0, callback=_finite, help="Time runs so many times faster."
        ),
    ] = 1.0,
    baud: Annotated[
        str,
        typer.Option(
            metavar="auto|unpaced|N",
            help="Rate of the line: the one the client has set; none, the line takes no time;"
            " or a number of bits a second: clients at another rate read and send garbage.",
        ),
    ] = "auto",
    tcp: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT",
            help="A TCP port instead of a terminal; port 0: a free one. With --robots the ports"
            " from there on, one each.",
        ),
    ] = None,
    rfc2217: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT",
            help="A serial port server (RFC 2217) instead of a terminal; ports as with --tcp.",
        ),
    ] = None,
    expose: Annotated[
        bool, typer.Option("--expose", help="Let other machines reach --tcp and --rfc2217.")
    ] = False,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPEC",
            help="Something that goes wrong on the line, such as drop:p=0.001 or"
            " cut:at=10,for=2 (see docs/faults.md); repeatable.",
        ),
    ] = None,
    fault_script: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A schedule of faults, TIME SPEC a line."),
    ] = None,
    turret: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help=f"A turret to mount: {', '.join(TURRETS)}; repeatable."),
    ] = None,
    firmware: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=VALUE]",
            help=f"A choice where sources differ: {', '.join(option_names())}"
            " (see docs/khepera-choices.md); repeatable.",
        ),
    ] = None,
    dead_man: Annotated[
        float | None,
        typer.Option(
            min=0.01,
            max=_LONGEST_PAUSE,
            callback=_finite,
            metavar="SECONDS",
            help="The robot stops by itself after so long without a request; a real one rolls on.",
        ),
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write down what passes on the line (see `replay`); with --robots in FILE-1,"
            " FILE-2 ...",
        ),
    ] = None,
    robots: Annotated[
        int,
        typer.Option(
            min=1,
            max=MOST_ROBOTS,
            help="So many in one world; names and links get a number: khepera-1, khepera-2 ...",
        ),
    ] = 1,
    link: Annotated[
        Path | None, typer.Option(help="Symbolic link to make to the terminal.")
    ] = None,
    robot: Annotated[str, typer.Option(metavar="NAME", help="Name in the Zenoh keys.")] = "khepera",
    listen: Annotated[
        str, typer.Option(metavar="ENDPOINT", help="Where Zenoh peers find this robot.")
    ] = DEFAULT_ENDPOINT,
    connect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT",
            help="A Zenoh peer to connect to, now or when it appears; repeatable.",
        ),
    ] = None,
    zenoh_config: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Zenoh's own configuration (JSON5), for routers, TLS and access control; --listen"
            " and --connect then do not count.",
        ),
    ] = None,
    camera_rate: Annotated[
        float,
        typer.Option(
            min=0.1, max=100.0, callback=_finite, help="Frames a second, while someone listens."
        ),
    ] = 10.0,
    zenoh: Annotated[
        bool, typer.Option("--zenoh/--no-zenoh", help="Offer camera, ground truth and reset.")
    ] = True,
    log_level: Annotated[LogLevel, typer.Option(help="What to log.")] = LogLevel.WARNING,
) -> None:
    """Switch a robot on, and leave it on until Ctrl-C or SIGTERM.

    Prints one line for each robot: its name, its terminal or URL, and the link to it.
    """
    handler = logging.StreamHandler()
    handler.setFormatter(PrintableFormatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    logging.basicConfig(level=log_level.upper(), handlers=[handler])
    load_physics()
    from khepera_emulator.app.daemon import Daemon
    from khepera_emulator.app.side_channel import SideChannel
    from khepera_emulator.robot.emulator import Setup, make_fleet
    from khepera_emulator.turrets import check_turrets

    ending = ctx.find_object(Ending) or Ending()
    with ExitStack() as stack:
        faults = [*(fault or []), *_scripted(fault_script)]
        setup = Setup(
            arena=load_arena(arena),
            model=find_model(model),
            drift=parse_drift(drift),
            seed=seed,
            baud=_parse_baud(baud),
            faults=parse_faults(faults),
            turrets=check_turrets(turret or []),
            choices=parse_choices(firmware or []),
            dead_man=dead_man,
        )
        _check_robot(robot)
        if link and (tcp or rfc2217):
            raise EmulatorError("--link points to a terminal, and --tcp and --rfc2217 have none")
        names = _numbered(robot, robots)
        links = _numbered_paths("--link", link, robots, stem=False)
        recordings = _numbered_paths("--record", record, robots)
        for path in recordings:
            check_output(path)
        ending.hold()  # what is made from here on is put away at the end
        held = [stack.enter_context(Link(each)) for each in links]
        emulators = make_fleet(setup, robots)
        stack.callback(emulators[0].close)
        channels: list[SideChannel | None] = [None] * robots
        for k, name in enumerate(names if zenoh else ()):
            channel = SideChannel(
                name, [listen], connect or [], camera_rate, channels[0], zenoh_config
            )
            channels[k] = stack.enter_context(channel)
        ports = []
        for k, claim in zip_longest(range(robots), held):
            moved = {"moved": claim.point_to} if claim else {}
            ports.append(open_port(tcp=tcp, rfc2217=rfc2217, expose=expose, place=k, **moved))
            stack.callback(ports[-1].close)
        logs: list[WireLog | None] = [None] * robots
        for k, path in enumerate(recordings):
            logs[k] = stack.enter_context(WireLog(path, _same_robot(ctx, faults, k + 1)))
        follow_rate = baud == "auto"
        daemon = Daemon(
            emulators[0],
            ports[0],
            Clock(speed),
            follow_rate=follow_rate,
            channel=channels[0],
            log=logs[0],
        )
        for k in range(1, robots):
            daemon.add(
                emulators[k], ports[k], follow_rate=follow_rate, channel=channels[k], log=logs[k]
            )
        for name, port, claim in zip_longest(names, ports, held):
            if claim:
                claim.point_to(port.url)
            _announce(f"{name} on {port.url}" + (f", link {claim.path}" if claim else ""))
        ending.call(daemon.stop)
        daemon.run()


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
        str, typer.Option(help=f"Robot that must fit: {' or '.join(MODELS)}.")
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
) -> None:
    """Play the requests of a wire log at their times, and compare the replies.

    Exit status: 0 if all are equal, 1 at the first difference, which is printed, 2 if the log is
    damaged: what stands before the damage is replayed all the same.
    """
    import serial

    import khepera_emulator  # noqa: F401 - registers khepera://
    from khepera_emulator.app.replay import Difference
    from khepera_emulator.app.replay import replay as play

    recording = read_log(file)
    url = port or _recorded_robot(file, recording)
    try:
        with serial.serial_for_url(url, timeout=1.0) as line, _stopping(line):
            result = play(recording, line, [word.strip() for word in ignore.split(",")])
    except (OSError, ValueError) as error:
        raise EmulatorError(f"cannot replay on {url}: {error}") from None
    if isinstance(result, Difference):
        typer.echo(str(result))
        raise typer.Exit(_DIFFERENT)
    typer.echo(f"{result} reply lines equal")
    if recording.damage:
        raise EmulatorError(f"{recording.damage}; only what stands before was replayed")


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


def _parse_baud(text: str) -> int | None:
    """Rate to begin with: None for a line that takes no time."""
    if text == "auto":
        return FIRST_RATE
    if text == "unpaced":
        return None
    if not _BAUD.fullmatch(text):
        raise EmulatorError(
            f"--baud {printable(text, 60)}: give auto, unpaced, or a rate such as 38400"
        )
    return int(text)


def _same_robot(ctx: typer.Context, faults: list[str], number: int) -> str:
    """URL of an in-process robot with the same options, one of as many."""
    options = [("fault", spec) for spec in faults]
    for name in ("model", "seed", "drift", "baud", "turret", "firmware", "dead_man"):
        value = ctx.params.get(name)
        values = value if isinstance(value, list | tuple) else [value]
        named = name.replace("_", "-")
        options += [(named, str(each)) for each in values if each is not None]
    if ctx.params["robots"] > 1:
        options += [("robots", str(ctx.params["robots"])), ("robot", str(number))]
    return robot_url(ctx.params["arena"], options)


def _scripted(script: Path | None) -> list[str]:
    if script is None:
        return []
    name = printable(str(script), 300)
    try:
        with script.open("rb") as file:
            text = file.read(MAX_SCRIPT + 1).decode()
    except OSError as error:
        raise EmulatorError(f"cannot read the fault script {name}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise EmulatorError(
            f"cannot read the fault script {name}: byte {error.start} is not UTF-8 text"
        ) from None
    return script_specs(text)


def _numbered(name: str, count: int) -> list[str]:
    """Names of so many robots; a single one keeps the name."""
    return [name] if count == 1 else [f"{name}-{k}" for k in range(1, count + 1)]


def _numbered_paths(option: str, path: Path | None, count: int, *, stem: bool = True) -> list[Path]:
    """Paths for so many robots, with their numbers at the end of the name or of its stem."""
    if path is None:
        return []
    check_name(option, path)
    if not stem:
        return [path.with_name(each) for each in _numbered(path.name, count)]
    return [path.with_name(each + path.suffix) for each in _numbered(path.stem, count)]


def _check_robot(name: str) -> None:
    if not _ROBOT.fullmatch(name):
        raise EmulatorError(
            f"--robot {quoted(name)}: a name is made of letters, digits, dots, dashes and"
            " underscores, 64 at most"
        )


def _announce(line: str) -> None:
    """Print a line; where nobody reads it, the robot lives on."""
    try:
        typer.echo(printable(line))
    except OSError:
        # what could not be written would be tried again at the end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
