"""Commands by which somebody else than the controller drives."""

import sys

import typer
from khepera_protocol.options import takes

from macor_hil.cli.common import extra
from macor_hil.cli.ending import kept, told
from macor_hil.cli.paths import check_file
from macor_hil.runs.by_hand.options import TeleopOptions
from macor_hil.runs.by_hand.teleop import teleop as drive_by_keys

app = typer.Typer()


@app.command(epilog="[cyan]macor-hil teleop --port runs/khepera --record runs/hand.mcap[/cyan]")
@takes(TeleopOptions)
def teleop(options: TeleopOptions) -> None:
    """Drive a robot by the keys of this terminal, and record the drive.

    w or up: straight on; a d or left right: an arc; s or down: back the way it came; q e: turn on
    the spot; space: stop; x: end. Each key is one command of the controller; held down it repeats,
    and without keys the robot stands. Watchers see the drive as a run, and learn trains from
    its recording. The robot is always stopped before the program ends, as after run.
    """
    if options.record is not None:
        check_file("--record", options.record)
        with extra("recording"):
            import macor_hil.telemetry.recordings.recorder  # noqa: F401
    report = drive_by_keys(options, sys.stdin.fileno(), told)
    kept_samples = "" if report.samples is None else f"{options.record}: {report.samples} samples; "
    driven = f"{kept_samples}{report.commands} commands; the robot stands"
    if report.signal:
        with kept(lambda: driven):
            raise KeyboardInterrupt
    typer.echo(driven)
