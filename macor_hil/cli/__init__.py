"""Command line of the controller: `macor-hil`."""

import logging
import signal
import sys
from typing import Final

import typer

from macor_hil.cli import driving, learning, measuring, ros, watching
from macor_hil.errors import MacorError
from protocol.text import PrintableFormatter, printable

_FAILED: Final = 2

_EXAMPLES = """[bold]Examples[/bold]

Train a map on the emulated robot, in virtual time:
[cyan]macor-hil train --map runs/corridor.npz[/cyan]

Score all planners on it:
[cyan]macor-hil trials --map runs/corridor.npz --trials 10[/cyan]

Drive a robot live, and watch it from another terminal:
[cyan]macor-hil run --port /dev/ttyUSB0 --camera video:0 --map runs/corridor.npz[/cyan]
[cyan]macor-hil monitor[/cyan]

All of it at once, with an emulated robot:
[cyan]macor-hil demo[/cyan]
"""

app = typer.Typer(
    help="MACOR: a controller that learns what it sees and plans by anticipation.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    epilog=_EXAMPLES,
)
for _part in (learning, driving, measuring, watching, ros):
    app.add_typer(_part.app)


def main() -> None:
    """Run the command line; errors are one sentence and exit status 2."""
    interrupted = False

    def interrupt(*_: object) -> None:
        nonlocal interrupted
        interrupted = True
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, interrupt)
    logs = logging.StreamHandler()
    logs.setFormatter(PrintableFormatter("%(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[logs])
    try:
        app()
    except MacorError as error:
        print(f"macor-hil: {printable(str(error))}", file=sys.stderr)  # noqa: T201
        sys.exit(_FAILED)
    except (Exception, KeyboardInterrupt) as error:
        # a library that is being imported may have made an error of its own of the interrupt
        if not (interrupted or isinstance(error, KeyboardInterrupt)):
            raise
        print("macor-hil: interrupted", file=sys.stderr)  # noqa: T201
        sys.exit(driving.INTERRUPTED)
