"""Commands that train maps."""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from khepera_protocol.options import takes
from khepera_protocol.text import printable
from khepera_protocol.zenoh.controller_payloads import Phase, State
from khepera_protocol.zenoh.payload_model import MOST_TEXT
from pydantic import Field

from macor_hil.cli.common import Bar, extra, hardware_of, progress_bar, shown
from macor_hil.cli.ending import kept
from macor_hil.cli.paths import check_file
from macor_hil.errors import MapError
from macor_hil.hardware.robots.robot import RobotKind
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain, own_code
from macor_hil.mind.map_file import save_map
from macor_hil.mind.options import MindOptions
from macor_hil.runs.learning.checkpoints import checkpoint_path, commands_kept
from macor_hil.runs.options import MapOptions, TrainOptions
from macor_hil.runs.robot_training import train_on
from macor_hil.safety.claim import claim
from macor_hil.safety.interruption import signals_taken_over

app = typer.Typer()


class LearnOptions(MapOptions):
    """Learning from recordings."""

    seed: int = Field(default=1, ge=0, description="Seed for the initial prototypes.")


@app.command(
    epilog="[cyan]macor-hil train --map runs/corridor.npz --seed 3[/cyan]\n\n"
    "[cyan]macor-hil train --clusterer neural-gas --planner expected --map runs/gas.npz[/cyan]"
)
@takes(TrainOptions, MindOptions)
def train(options: TrainOptions, mind: MindOptions) -> None:
    """Train a map: random commands, and reactively selected ones if asked for.

    A training that was interrupted goes on from its last checkpoint when started again. Without
    the emulator's reset that is after every command: stop with Ctrl-C when the battery is low.
    """
    train_map_of(options, mind)


def train_map_of(options: TrainOptions, mind: MindOptions) -> None:
    """Train a map, with a progress bar.

    Raises:
        MacorError: it cannot be trained, or the hardware fails.
    """
    map_file, schedule = options.map_file, options.schedule
    check_file("--map", map_file)
    if map_file.exists() and not options.restart:
        raise MapError(f"the map {map_file} is there already; train it anew with --restart")
    settings = mind.mind_settings(options.measured().mirror)
    build_brain(settings)  # what cannot be composed is told before anything is opened
    with (
        kept(lambda: _what_is_kept(options, own_code(settings))),
        claim(map_file),
        signals_taken_over() as interruption,
        hardware_of(options) as hardware,
        progress_bar(schedule.commands) as bar,
        shown(hardware, options, partial(_training_of, options, hardware.robot.kind)) as watched,
    ):
        if options.restart:
            checkpoint_path(map_file).unlink(missing_ok=True)

        def progress(done: int) -> None:
            bar(done)
            watched.progress(done)

        ask = partial(_ask, bar) if sys.stdin.isatty() else None
        brain = train_on(watched.hardware, options, settings, interruption.check, progress, ask)
    _report(map_file, brain, schedule.commands)


def _training_of(options: TrainOptions, kind: RobotKind, done: int) -> State:
    """Return the state of a training after so many commands, for those who watch."""
    return State(
        phase=Phase.TRAINING,
        planner="random commands" if not options.reactive else "random and reactive commands",
        port=options.port[:MOST_TEXT],
        camera=options.camera[:MOST_TEXT],
        map=str(options.map_file)[:MOST_TEXT],
        driven=done,
        limit=options.schedule.commands,
        robot_kind=kind.value,
    )


@app.command(epilog="[cyan]macor-hil learn runs/drive.mcap --map runs/learned.npz[/cyan]")
@takes(LearnOptions, MindOptions)
def learn(
    options: LearnOptions,
    mind: MindOptions,
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Recordings.")],
) -> None:
    """Train a map from recordings of drives (see `record`), without a robot."""
    with extra("recording"):
        from macor_hil.telemetry.recordings.recording import play_recording
    from macor_hil.runs.learning.recorded_drives import learn as take_in

    map_file = options.map_file
    check_file("--map", map_file)
    if map_file.exists():
        raise MapError(f"the map {map_file} is there already; name another --map")
    brain = build_brain(mind.mind_settings())
    recordings = (play_recording(file)[1] for file in files)
    driven = take_in(brain, recordings, np.random.default_rng(options.seed))
    save_map(map_file, brain, {"recordings": [str(file) for file in files]})
    _report(map_file, brain, driven)


def _report(map_file: Path, brain: Brain, commands: int) -> None:
    typer.echo(
        f"{map_file}: {brain.clusterer.size} situations, {brain.transitions} transitions"
        f" from {commands} commands"
    )


def _ask(bar: Bar, what: str) -> None:
    """Have the operator see to something; Ctrl-C ends the training, which can go on later."""
    bar.ask(f"\a{printable(what)}. Press Enter when done")


def _what_is_kept(options: TrainOptions, allowed: list[str]) -> str:
    commands = commands_kept(options.map_file, options.schedule, allowed)
    if not commands:
        return "there was no checkpoint yet, and nothing is kept"
    return (
        f"{commands} of {options.schedule.commands} commands are kept in"
        f" {checkpoint_path(options.map_file)}; the same command goes on from there"
    )
