"""The commands of `macor-hil`, and what becomes of their errors and signals."""

import logging
import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, ClassVar, Final

import typer
from khepera_protocol.system.program_parts import Described, Parts
from khepera_protocol.text import OptionError, PrintableFormatter, printable
from khepera_protocol.version import VersionOption

from macor_hil.cli.ending import CLOSED_OUTPUT, SUMMARY, Status, closed_output, status_after
from macor_hil.errors import MacorError, NotStoppedError, is_lost
from macor_hil.safety.interruption import Interruption, unbroken

_log = logging.getLogger(__name__)

_EXAMPLES = f"""[bold]Examples[/bold]

Train a map on the emulated robot, in virtual time:
[cyan]macor-hil train --map runs/corridor.npz[/cyan]

Score all planners on it:
[cyan]macor-hil trials --map runs/corridor.npz --trials 10[/cyan]

Drive a robot live, and watch it from another terminal:
[cyan]macor-hil run --port /dev/ttyUSB0 --camera video:0 --map runs/corridor.npz[/cyan]
[cyan]macor-hil monitor[/cyan]

All of it at once, with an emulated robot:
[cyan]macor-hil demo[/cyan]

[bold]Exit status[/bold]

{SUMMARY}
"""

_ENDED: Final = {"SIGINT": "interrupted", CLOSED_OUTPUT: "nobody reads the standard output"}
"""Words for an end by somebody, where they are not `ended by` them."""


class _Program(Parts):
    """All commands, in the order of the help."""

    first: ClassVar[Mapping[str, Described]] = {
        "config": (
            "macor_hil.cli.driving",
            "Check or print a TOML file of options, for --config.",
        )
    }
    modules = tuple(
        f"macor_hil.cli.{part}"
        for part in (
            *("learning", "scoring", "driving", "by_hand", "measuring", "watching", "viewing"),
            *("classroom", "ros"),
        )
    )

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Import a command; a signal that comes meanwhile ends the program when that is done.

        In the middle of it, it would be lost in a callback of the import.
        """
        with unbroken():
            return super().get_command(ctx, cmd_name)


app = typer.Typer(
    cls=_Program,
    help="MACOR: a controller that learns what it sees and plans by anticipation.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    epilog=_EXAMPLES,
    context_settings={"auto_envvar_prefix": "MACOR_HIL"},
)


@app.callback()
def _options(version: VersionOption = False) -> None:
    """Take the options that stand before a command."""


def run() -> int:
    """Run the command line; errors are one sentence. Returns the exit status."""
    logs = logging.StreamHandler()
    logs.setFormatter(PrintableFormatter("%(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[logs])
    with Interruption(closed_output) as interruption:
        status = _run(interruption)
        interruption.hold()
        try:
            sys.stdout.flush()
        except OSError as error:
            status = _failed(error, interruption)
            # what cannot be written now cannot be when the interpreter ends
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status


def _run(interruption: Interruption) -> int:
    try:
        app()
    except (MacorError, OptionError) as error:
        _say(str(error))
        if not interruption.name or isinstance(error, NotStoppedError):
            return Status.LOST if is_lost(error) else Status.FAILED
    except OSError as error:
        if not interruption.name:
            return _failed(error, interruption)
    except SystemExit as ended:
        if isinstance(ended.__context__, BrokenPipeError):
            interruption.ask(CLOSED_OUTPUT)
        if not interruption.name:
            return int(ended.code or 0)
    except (Exception, KeyboardInterrupt) as error:
        # a library that is being imported may have made an error of its own of the interrupt
        if not (interruption.name or isinstance(error, KeyboardInterrupt)):
            raise
        interruption.ask("SIGINT")
    _say(_farewell(interruption))
    return status_after(interruption.name)


def _failed(error: OSError, interruption: Interruption) -> int:
    if isinstance(error, BrokenPipeError):
        interruption.ask(CLOSED_OUTPUT)
        _say(_farewell(interruption))
    else:
        what = f"{error.strerror or error}"
        _say(f"cannot go on: {what}" + (f": {error.filename}" if error.filename else ""))
    return Status.FAILED


def _farewell(interruption: Interruption) -> str:
    ended = _ENDED.get(interruption.name, f"ended by {interruption.name}")
    return f"{ended}; {interruption.kept}" if interruption.kept else ended


def _say(sentence: str) -> None:
    from khepera_protocol.logs import logs_json

    if logs_json():
        _log.error(sentence)
        return
    with suppress(OSError):  # nobody reads that either
        print(f"macor-hil: {printable(sentence)}", file=sys.stderr)  # noqa: T201
