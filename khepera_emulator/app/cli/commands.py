"""The commands of `khepera-emulator`."""

import os
import sys

import typer
from khepera_protocol.config_file import add_config
from khepera_protocol.logs import LogOptions, set_up_log
from khepera_protocol.options import takes
from khepera_protocol.text import printable
from khepera_protocol.version import VersionOption

from khepera_emulator.app.cli import bench_commands
from khepera_emulator.app.cli.arena_command import ArenaOptions, arenas
from khepera_emulator.app.cli.replay_command import ReplayOptions, replay
from khepera_emulator.app.ending import STATUS, Ending
from khepera_emulator.app.options import LineOptions, ZenohOptions
from khepera_emulator.robot.options import RobotOptions

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

Put a robot that runs somewhere else, and see where it is:
[cyan]khepera-emulator place 0.3 0 1.57[/cyan]
[cyan]khepera-emulator watch[/cyan]

[bold]Exit status[/bold]

{STATUS}
"""


app = typer.Typer(
    help="An emulated Khepera robot on a serial line.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"auto_envvar_prefix": "KHEPERA_EMULATOR"},
)


@app.callback()
def program(version: VersionOption = False) -> None:
    """Take the options that stand before a command."""


@app.command(epilog=_EXAMPLES)
@takes(RobotOptions, LineOptions, ZenohOptions, LogOptions)
def run(
    robots: RobotOptions,
    line: LineOptions,
    zenoh: ZenohOptions,
    log: LogOptions,
    ctx: typer.Context,
) -> None:
    """Switch a robot on, and leave it on until Ctrl-C or SIGTERM.

    Prints one line for each robot: its name, its terminal or URL, and the link to it.
    """
    set_up_log(log)
    from khepera_emulator.app.serving import serve

    serve(robots, line, zenoh, ctx.find_object(Ending) or Ending(), _announce)


app.command(epilog="[cyan]khepera-emulator arenas --generate 7 --out runs/seven.toml[/cyan]")(
    takes(ArenaOptions, config=False)(arenas)
)
app.command()(takes(ReplayOptions, config=False)(replay))
app.add_typer(bench_commands.app)
add_config(app, "run")


def _announce(line: str) -> None:
    """Print a line; where nobody reads it, the robot lives on."""
    try:
        typer.echo(printable(line))
    except OSError:
        # what could not be written would be tried again at the end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
