"""Command line of the controller: `macor-hil`."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from macor_hil.agent import Agent
from macor_hil.brain import Settings
from macor_hil.checkpoints import checkpoint_path, train_map
from macor_hil.drive import Driver
from macor_hil.errors import MacorError, MapError
from macor_hil.hardware import Hardware, is_embedded, open_hardware
from macor_hil.map_file import load_map
from macor_hil.planners import PLANNERS
from macor_hil.training import Recovery, Schedule
from macor_hil.trials import Spread, Trial, run_trial
from protocol.side_channel import Reset

_FAILED: Final = 2
_INTERRUPTED: Final = 130

_EXAMPLES = """[bold]Examples[/bold]

Train a map on the emulated robot, in virtual time:
[cyan]macor-hil train --map runs/corridor.npz[/cyan]

Score both planners on it:
[cyan]macor-hil trials --map runs/corridor.npz --trials 10[/cyan]
"""

app = typer.Typer(
    help="MACOR: a controller that learns what it sees and plans by anticipation.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    epilog=_EXAMPLES,
)

_DEFAULT_PORT = "khepera://corridor"

PortOption = Annotated[
    str, typer.Option(help="Serial device or pySerial URL; khepera://ARENA is a robot in-process.")
]
CameraOption = Annotated[
    str, typer.Option(help="auto, port, zenoh\\[:KEY], video:DEVICE or video:FILE.")
]
BaudOption = Annotated[int, typer.Option(min=1, help="Rate of the serial line, bits a second.")]
MapOption = Annotated[Path, typer.Option("--map", help="Map file.")]
SeedOption = Annotated[int, typer.Option(min=0, help="Seed of all random choices.")]


class RecoveryChoice(StrEnum):
    """What follows a collision in training."""

    AUTO = "auto"
    RESET = "reset"
    BACK = "back"


@app.command(epilog="[cyan]macor-hil train --map runs/corridor.npz --seed 3[/cyan]")
def train(
    port: PortOption = _DEFAULT_PORT,
    camera: CameraOption = "auto",
    baud: BaudOption = 9600,
    map_file: MapOption = Path("runs/corridor.npz"),
    seed: SeedOption = 1,
    nodes: Annotated[int, typer.Option(min=1, help="Most situations there can be.")] = 50,
    vigilance: Annotated[float, typer.Option(min=0.0, max=1.0, help="Fuzzy ART's rho.")] = 0.9,
    tuning: Annotated[
        int, typer.Option(min=10, help="Commands driven first, to tune the receptive fields.")
    ] = 400,
    random: Annotated[int, typer.Option(min=0, help="Randomly selected commands.")] = 11_000,
    reactive: Annotated[int, typer.Option(min=0, help="Reactively selected commands.")] = 2_000,
    recovery: Annotated[
        RecoveryChoice,
        typer.Option(help="After a collision: drive back, or the emulator's reset."),
    ] = RecoveryChoice.AUTO,
    restart: Annotated[
        bool, typer.Option("--restart", help="Begin anew, even with a map or checkpoint there.")
    ] = False,
) -> None:
    """Train a map: random commands, then reactively selected ones.

    A training that was interrupted goes on from its last checkpoint when started again.
    """
    if restart:
        checkpoint_path(map_file).unlink(missing_ok=True)
    elif map_file.exists():
        raise MapError(f"the map {map_file} is there already; train it anew with --restart")
    if recovery is RecoveryChoice.AUTO:
        recovery = RecoveryChoice.RESET if is_embedded(port) else RecoveryChoice.BACK
    schedule = Schedule(
        tuning=tuning,
        random=random,
        reactive=reactive,
        seed=seed,
        recovery=Recovery(recovery.value),
    )
    settings = Settings(nodes=nodes, vigilance=vigilance)
    with _hardware(port, camera, baud) as hardware, _progress(schedule.commands) as progress:
        devices = Driver(hardware.robot), hardware.camera, hardware.bench
        brain = train_map(map_file, settings, schedule, port, devices, progress)
    typer.echo(
        f"{map_file}: {brain.art.size} situations, {np.count_nonzero(brain.map.z)} transitions"
        f" from {schedule.commands} commands"
    )


@app.command(epilog="[cyan]macor-hil trials --map runs/corridor.npz --trials 20[/cyan]")
def trials(
    map_file: MapOption = Path("runs/corridor.npz"),
    port: PortOption = _DEFAULT_PORT,
    planner: Annotated[
        list[str] | None, typer.Option(help="Planner; give several. Default: all.")
    ] = None,
    count: Annotated[int, typer.Option("--trials", min=1, help="Trials of each planner.")] = 10,
    seed: SeedOption = 1,
) -> None:
    """Score planners on a map: trials of 40 commands at most, from starts near the arena's own."""
    brain, _ = load_map(map_file)
    names = planner or list(PLANNERS)
    table = Table("planner", "trials", "commands", "reinforcement", "collided", "touched")
    with (
        _hardware(port, "auto", 9600) as hardware,
        _progress(count * len(names)) as progress,
    ):
        if hardware.bench is None:
            raise MacorError(f"trials need an emulated robot, which {port} is not")
        agent = Agent(brain, Driver(hardware.robot), hardware.camera)
        for number, name in enumerate(names):
            results = []
            for k in range(count):
                results.append(_trial(agent, name, hardware, np.random.default_rng([seed, k])))
                progress(number * count + k + 1)
            table.add_row(name, str(count), *_summary(results))
    Console().print(table)


def _trial(agent: Agent, name: str, hardware: Hardware, rng: np.random.Generator) -> Trial:
    assert hardware.bench is not None
    start = hardware.bench.reset(Reset(seed=int(rng.integers(2**31)))).pose
    pose = Spread().draw(start, rng)
    return run_trial(agent, PLANNERS[name](), hardware.bench, Reset(pose=pose), rng)


def _summary(results: list[Trial]) -> list[str]:
    lengths = np.array([trial.length for trial in results])
    totals = np.array([trial.total for trial in results])
    return [
        f"{lengths.mean():.1f} ± {lengths.std():.1f}",
        f"{totals.mean():.1f} ± {totals.std():.1f}",
        str(sum(trial.collided for trial in results)),
        str(sum(trial.touched for trial in results)),
    ]


@contextmanager
def _hardware(port: str, camera: str, baud: int) -> Iterator[Hardware]:
    with open_hardware(port, camera, baud=baud) as hardware:
        yield hardware


@contextmanager
def _progress(total: int) -> Iterator[Callable[[int], None]]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("driving", total=total)
        yield lambda done: bar.update(task, completed=done)


def main() -> None:
    """Run the command line; errors are one sentence and exit status 2."""
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        app()
    except MacorError as error:
        print(f"macor-hil: {error}", file=sys.stderr)  # noqa: T201
        sys.exit(_FAILED)
    except KeyboardInterrupt:
        print("macor-hil: interrupted", file=sys.stderr)  # noqa: T201
        sys.exit(_INTERRUPTED)


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    main()
