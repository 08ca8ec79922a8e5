"""Commands that train maps and score them."""

import sys
from dataclasses import replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

from macor_hil.agent import Agent
from macor_hil.bench import Bench
from macor_hil.brain import Brain, Settings
from macor_hil.cameras.checks import CheckedCamera, limits_for
from macor_hil.cameras.watch import CameraWatch
from macor_hil.caretaker import Caretaker
from macor_hil.checkpoints import checkpoint_path, commands_kept, train_map
from macor_hil.claim import claim
from macor_hil.cli.ending import kept
from macor_hil.cli.options import (
    COLUMNS,
    DEFAULT_MAP,
    DEFAULT_PORT,
    Bar,
    BaudOption,
    CameraOption,
    ConnectOption,
    MapOption,
    PortOption,
    ProfileOption,
    RobotOption,
    SeedOption,
    SpeedOption,
    ZenohConfigOption,
    extra,
    hardware_of,
    progress_bar,
    shown,
)
from macor_hil.cli.paths import check_file, check_folder
from macor_hil.demo import DEFAULT_SEED
from macor_hil.drive import Driver, DriveSettings, all_of
from macor_hil.errors import MacorError, MapError
from macor_hil.hardware import is_embedded
from macor_hil.interruption import signals_taken_over
from macor_hil.map_file import load_map, save_map
from macor_hil.planners import PLANNERS
from macor_hil.profile import RobotProfile, load_profile
from macor_hil.service import find_planner
from macor_hil.training import Recovery, Schedule
from macor_hil.trials import Spread, Trial, run_trial
from protocol.side_channel import DEFAULT_ENDPOINT, Reset

_DRIVE: Final = DriveSettings()

app = typer.Typer()


class RecoveryChoice(StrEnum):
    """What follows a collision in training."""

    AUTO = "auto"
    RESET = "reset"
    BACK = "back"


@app.command(epilog="[cyan]macor-hil train --map runs/corridor.npz --seed 3[/cyan]")
def train(
    port: PortOption = DEFAULT_PORT,
    camera: CameraOption = "auto",
    baud: BaudOption = 9600,
    map_file: MapOption = DEFAULT_MAP,
    seed: SeedOption = DEFAULT_SEED,
    nodes: Annotated[int, typer.Option(min=1, help="Most situations there can be.")] = 50,
    vigilance: Annotated[float, typer.Option(min=0.0, max=1.0, help="Fuzzy ART's rho.")] = 0.9,
    tuning: Annotated[
        int, typer.Option(min=10, help="Commands driven first, to tune the receptive fields.")
    ] = 400,
    random: Annotated[int, typer.Option(min=0, help="Randomly selected commands.")] = 13_000,
    reactive: Annotated[
        int,
        typer.Option(
            min=0,
            help="Reactively selected commands after them; the paper's section 3.1 has"
            " --random 11000 --reactive 2000.",
        ),
    ] = 0,
    recovery: Annotated[
        RecoveryChoice,
        typer.Option(help="After a collision: drive back, or the emulator's reset."),
    ] = RecoveryChoice.AUTO,
    robot: RobotOption = "khepera",
    connect: ConnectOption = [DEFAULT_ENDPOINT],  # noqa: B006
    zenoh_config: ZenohConfigOption = None,
    profile: ProfileOption = None,
    speed: SpeedOption = _DRIVE.speed,
    listen: Annotated[
        list[str],
        typer.Option(
            metavar="ENDPOINT", help="Where watchers find an emulated robot inside this process."
        ),
    ] = [],  # noqa: B006 - typer copies it
    restart: Annotated[
        bool, typer.Option("--restart", help="Begin anew, even with a map or checkpoint there.")
    ] = False,
) -> None:
    """Train a map: random commands, and reactively selected ones if asked for.

    A training that was interrupted goes on from its last checkpoint when started again. Without
    the emulator's reset that is after every command: stop with Ctrl-C when the battery is low.
    """
    if listen and not is_embedded(port):
        raise MacorError("--listen shows a robot in this process, and needs a khepera:// port")
    check_file("--map", map_file)
    if map_file.exists() and not restart:
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
    measured = load_profile(profile) if profile else RobotProfile()
    drive = DriveSettings(wheels=measured.wheels, speed=speed)
    if measured.mirror:
        settings = replace(settings, mirror=measured.mirror)
    with (
        kept(lambda: _what_is_kept(map_file, schedule)),
        claim(map_file),
        signals_taken_over() as interruption,
        hardware_of(port, camera, baud, robot, connect, zenoh_config) as hardware,
        progress_bar(schedule.commands) as count,
        shown(hardware, robot, listen) as show,
    ):
        if restart:
            checkpoint_path(map_file).unlink(missing_ok=True)

        def progress(done: int) -> None:
            count(done)
            show()

        eyes = CheckedCamera(hardware.camera, limits_for(settings.mirror))
        train_it = partial(train_map, map_file, settings, schedule, port)
        if schedule.recovery is Recovery.RESET:
            driver = Driver(hardware.robot, drive, interruption.check)
            brain = train_it((driver, eyes, hardware.bench), progress)
        else:
            ask = partial(_ask, count) if sys.stdin.isatty() else None
            care = Caretaker(hardware.robot, eyes, ask)
            with CameraWatch(eyes) as watch:
                driver = Driver(hardware.robot, drive, all_of(interruption.check, watch.guard))
                brain = train_it((driver, eyes, None), progress, care, 1)
    typer.echo(
        f"{map_file}: {brain.art.size} situations, {len(brain.map)} transitions"
        f" from {schedule.commands} commands"
    )


def _ask(bar: Bar, what: str) -> None:
    """Have the operator see to something; Ctrl-C ends the training, which can go on later."""
    bar.ask(f"\a{what}. Press Enter when done")


def _what_is_kept(map_file: Path, schedule: Schedule) -> str:
    commands = commands_kept(map_file, schedule)
    if not commands:
        return "there was no checkpoint yet, and nothing is kept"
    return (
        f"{commands} of {schedule.commands} commands are kept in {checkpoint_path(map_file)}; the"
        " same command goes on from there"
    )


@app.command(epilog="[cyan]macor-hil trials --map runs/corridor.npz --trials 20[/cyan]")
def trials(
    map_file: MapOption = DEFAULT_MAP,
    port: PortOption = DEFAULT_PORT,
    planner: Annotated[
        list[str] | None, typer.Option(help="Planner; give several. Default: all.")
    ] = None,
    count: Annotated[int, typer.Option("--trials", min=1, help="Trials of each planner.")] = 10,
    speed: SpeedOption = _DRIVE.speed,
    baud: BaudOption = 9600,
    robot: RobotOption = "khepera",
    connect: ConnectOption = [DEFAULT_ENDPOINT],  # noqa: B006
    zenoh_config: ZenohConfigOption = None,
    seed: SeedOption = DEFAULT_SEED,
) -> None:
    """Score planners on a map: trials of 40 commands at most, from starts near the arena's own.

    Ctrl-C shows the trials driven so far.
    """
    brain, _ = load_map(map_file)
    names = list(dict.fromkeys(planner or PLANNERS))
    for name in names:
        find_planner(name)
    results: dict[str, list[Trial]] = {}

    def driven() -> str:
        done, of = sum(map(len, results.values())), count * len(names)
        return f"{done} of {of} trials were driven; the same command begins anew"

    try:
        with (
            kept(driven),
            signals_taken_over() as interruption,
            hardware_of(port, "auto", baud, robot, connect, zenoh_config) as hardware,
            progress_bar(count * len(names)) as progress,
        ):
            if hardware.bench is None:
                raise MacorError(f"trials need an emulated robot, which {port} is not")
            driver = Driver(hardware.robot, DriveSettings(speed=speed), interruption.check)
            agent = Agent(brain, driver, hardware.camera)
            for number, name in enumerate(names):
                of_planner = results.setdefault(name, [])
                for k in range(count):
                    of_planner.append(_trial(agent, name, hardware.bench, [seed, k]))
                    progress(number * count + k + 1)
    finally:
        _show(results)


def _trial(agent: Agent, name: str, bench: Bench, seed: list[int]) -> Trial:
    rng = np.random.default_rng(seed)
    start = bench.reset(Reset(seed=int(rng.integers(2**31)))).pose
    pose = Spread().draw(start, rng)
    return run_trial(agent, find_planner(name), bench, Reset(pose=pose), rng)


def _show(results: dict[str, list[Trial]]) -> None:
    """Print a table of all trials that were driven."""
    table = Table("planner", "trials", "commands", "reinforcement", "collided", "touched")
    for name, trials in results.items():
        if trials:
            table.add_row(name, str(len(trials)), *_summary(trials))
    if table.rows:
        Console().print(table)


def _summary(results: list[Trial]) -> list[str]:
    lengths = np.array([trial.length for trial in results])
    totals = np.array([trial.total for trial in results])
    return [
        f"{lengths.mean():.1f} ± {lengths.std():.1f}",
        f"{totals.mean():.1f} ± {totals.std():.1f}",
        str(sum(trial.collided for trial in results)),
        str(sum(trial.touched for trial in results)),
    ]


@app.command(epilog="[cyan]macor-hil reproduce table1 --seeds 10[/cyan]")
def reproduce(
    name: Annotated[
        str,
        typer.Argument(
            help="figure2 to figure5 or table1 of the paper; beyond, goals, drift; peers, which"
            " needs the extra of that name; or all but peers."
        ),
    ],
    seeds: Annotated[int, typer.Option(min=1, help="Training seeds: 1 to this number.")] = 30,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1, help="Processes to share the work.", show_default="one for each processor"
        ),
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Scheduler of a dask cluster that does the work instead, such as"
            " tcp://127.0.0.1:8786; its workers share the folder of --out.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="For recordings, results and the report.")] = Path(
        "runs/reproduction"
    ),
) -> None:
    """Run an experiment of the paper over many training seeds, and write a report page.

    What is done stays done: a run that was interrupted goes on when started again.
    """
    with extra("experiments"):
        from macor_hil.experiments import catalogue, runner
    chosen = catalogue.find(name)
    check_folder("--out", out)
    with (
        kept(lambda: f"what is done is kept in {out}; the same command goes on from there"),
        Progress(*COLUMNS, console=Console(stderr=True)) as bars,
    ):
        tasks: dict[str, TaskID] = {}

        def watch(what: str, done: int, of: int) -> None:
            if done == 0:
                tasks[what] = bars.add_task(what, total=of)
            bars.update(tasks[what], completed=done)

        page = runner.reproduce(chosen, seeds, workers or runner.ALL, out, watch, cluster)
    typer.echo(str(page))


@app.command(epilog="[cyan]macor-hil learn runs/drive.mcap --map runs/learned.npz[/cyan]")
def learn(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Recordings.")],
    map_file: MapOption = DEFAULT_MAP,
    nodes: Annotated[int, typer.Option(min=1, help="Most situations there can be.")] = 50,
    vigilance: Annotated[float, typer.Option(min=0.0, max=1.0, help="Fuzzy ART's rho.")] = 0.9,
    seed: Annotated[int, typer.Option(min=0, help="Of where the prototypes begin.")] = 1,
) -> None:
    """Train a map from recordings of drives (see `record`), without a robot."""
    with extra("recording"):
        from macor_hil.telemetry.recording import read_recording
    from macor_hil.learning import learn as take_in

    check_file("--map", map_file)
    if map_file.exists():
        raise MapError(f"the map {map_file} is there already; name another --map")
    brain = Brain(Settings(nodes=nodes, vigilance=vigilance))
    recordings = [read_recording(file)[1] for file in files]
    driven = take_in(brain, recordings, np.random.default_rng(seed))
    save_map(map_file, brain, {"recordings": [str(file) for file in files]})
    typer.echo(
        f"{map_file}: {brain.art.size} situations, {len(brain.map)} transitions"
        f" from {driven} commands"
    )
