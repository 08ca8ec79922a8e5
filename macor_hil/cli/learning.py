"""Commands that train maps and score them."""

import sys
from dataclasses import replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer
from khepera_protocol.text import printable
from khepera_protocol.zenoh.payloads import DEFAULT_ENDPOINT, Reset
from rich import box
from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

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
from macor_hil.errors import MacorError, MapError
from macor_hil.hardware.bench import Bench
from macor_hil.hardware.cameras.checks import CheckedCamera, limits_for
from macor_hil.hardware.cameras.watchdog import CameraWatch
from macor_hil.hardware.devices import is_embedded
from macor_hil.hardware.driver import Driver, DriveSettings, all_of
from macor_hil.hardware.profile import RobotProfile, load_profile
from macor_hil.mind.catalogue import PLANNERS, build_brain, make_planner, memory_for
from macor_hil.mind.map_file import load_map, save_map
from macor_hil.mind.settings import MOST_NODES, MindSettings, Part
from macor_hil.runs.agent import Agent
from macor_hil.runs.checkpoints import checkpoint_path, commands_kept, train_map
from macor_hil.runs.demo import DEFAULT_SEED
from macor_hil.runs.possible import Possible, compare, judge
from macor_hil.runs.recovery import Caretaker
from macor_hil.runs.training import Recovery, Schedule
from macor_hil.runs.trials import Spread, Trial, run_trial
from macor_hil.safety.claim import claim
from macor_hil.safety.interruption import signals_taken_over

_DRIVE: Final = DriveSettings()

app = typer.Typer()

_MOST_COMMANDS: Final = 500_000
"""Of each kind: a map of more transitions than both together would not be read again."""


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
    nodes: Annotated[
        int, typer.Option(min=1, max=MOST_NODES, help="Most situations there can be.")
    ] = 50,
    vigilance: Annotated[float, typer.Option(min=0.0, max=1.0, help="Fuzzy ART's rho.")] = 0.9,
    tuning: Annotated[
        int,
        typer.Option(
            min=10, max=4_000, help="Commands driven first, to tune the receptive fields."
        ),
    ] = 400,
    random: Annotated[
        int, typer.Option(min=0, max=_MOST_COMMANDS, help="Randomly selected commands.")
    ] = 13_000,
    reactive: Annotated[
        int,
        typer.Option(
            min=0,
            max=_MOST_COMMANDS,
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
    settings = MindSettings(nodes, clusterer=Part("fuzzy-art", {"vigilance": vigilance}))
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
        f"{map_file}: {brain.clusterer.size} situations, {brain.transitions} transitions"
        f" from {schedule.commands} commands"
    )


def _ask(bar: Bar, what: str) -> None:
    """Have the operator see to something; Ctrl-C ends the training, which can go on later."""
    bar.ask(f"\a{printable(what)}. Press Enter when done")


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

    Possible: the share of the commands that can be driven from the same start without a
    collision, as a search over the arena's floor plan tells. Needless: collisions where none was
    necessary. Ctrl-C shows the trials driven so far.
    """
    brain, _ = load_map(map_file)
    known = {name: make_planner(name) for name in planner or PLANNERS.names()}
    for one in known.values() if planner else ():
        memory_for(brain, one)
    names = [name for name, one in known.items() if one.memory in brain.memories]
    results: dict[str, list[Trial]] = {}
    possible: list[Possible] = []

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
            possible_from = judge(hardware.bench)
            driver = Driver(hardware.robot, DriveSettings(speed=speed), interruption.check)
            agent = Agent(brain, driver, hardware.camera)
            for number, name in enumerate(names):
                of_planner = results.setdefault(name, [])
                for k in range(count):
                    of_planner.append(_trial(agent, name, hardware.bench, [seed, k]))
                    if k == len(possible):  # every planner has the same starts
                        possible.append(possible_from(of_planner[k].path[0]))
                    progress(number * count + k + 1)
    finally:
        _show(results, possible)


def _trial(agent: Agent, name: str, bench: Bench, seed: list[int]) -> Trial:
    rng = np.random.default_rng(seed)
    start = bench.reset(Reset(seed=int(rng.integers(2**31)))).pose
    pose = Spread().draw(start, rng)
    return run_trial(agent, make_planner(name), bench, Reset(pose=pose), rng)


def _show(results: dict[str, list[Trial]], possible: list[Possible]) -> None:
    """Print a table of all trials that were driven, and what was possible."""
    table = Table(
        *("planner", "commands", "reinforcement", "collided", "touched", "possible", "needless"),
        box=box.SIMPLE_HEAD,
        collapse_padding=True,
        pad_edge=False,
        title=f"{max(map(len, results.values()), default=0)} trials of each planner",
    )
    for name, trials in results.items():
        if trials:
            table.add_row(name, *_summary(trials, possible[: len(trials)]))
    if table.rows:
        Console().print(table)
        typer.echo(_starts(possible))


def _summary(results: list[Trial], possible: list[Possible]) -> list[str]:
    lengths = np.array([trial.length for trial in results])
    totals = np.array([trial.total for trial in results])
    shares = compare(results, possible)
    return [
        f"{lengths.mean():.1f} ± {lengths.std():.1f}",
        f"{totals.mean():.1f} ± {totals.std():.1f}",
        str(sum(trial.collided for trial in results)),
        str(sum(trial.touched for trial in results)),
        "-" if shares.share is None else f"{100 * shares.share:.0f} %",
        f"{shares.needless} of {shares.free}",
    ]


def _starts(possible: list[Possible]) -> str:
    """Return a sentence on the starts from which not all commands are possible."""
    hopeless = sum(each.length == 0 for each in possible)
    short = sum(not each.everything for each in possible) - hopeless
    if hopeless + short == 0:
        return "From every start all commands are possible."
    return (
        f"From {hopeless} of {len(possible)} starts nothing is possible: they count in no share."
        f" From {short} a collision is inevitable later on."
    )


@app.command(epilog="[cyan]macor-hil reproduce table1 --seeds 10[/cyan]")
def reproduce(
    name: Annotated[
        str,
        typer.Argument(
            help="figure2 to figure5 or table1 of the paper; beyond, goals, drift, arenas; peers,"
            " which needs the extra of that name; or all but peers."
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
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Shorter trainings in fewer arenas: of arenas only."),
    ] = False,
) -> None:
    """Run an experiment of the paper over many training seeds, and write a report page.

    What is done stays done: a run that was interrupted goes on when started again.
    """
    with extra("experiments"):
        from macor_hil.experiments import catalogue
        from macor_hil.experiments.sweep import runner
    chosen = catalogue.find(name)
    if quick:
        chosen = catalogue.quick(chosen)
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
    nodes: Annotated[
        int, typer.Option(min=1, max=MOST_NODES, help="Most situations there can be.")
    ] = 50,
    vigilance: Annotated[float, typer.Option(min=0.0, max=1.0, help="Fuzzy ART's rho.")] = 0.9,
    seed: Annotated[int, typer.Option(min=0, help="Of where the prototypes begin.")] = 1,
) -> None:
    """Train a map from recordings of drives (see `record`), without a robot."""
    with extra("recording"):
        from macor_hil.telemetry.recordings.recording import play_recording
    from macor_hil.runs.recorded_drives import learn as take_in

    check_file("--map", map_file)
    if map_file.exists():
        raise MapError(f"the map {map_file} is there already; name another --map")
    brain = build_brain(MindSettings(nodes, clusterer=Part("fuzzy-art", {"vigilance": vigilance})))
    recordings = (play_recording(file)[1] for file in files)
    driven = take_in(brain, recordings, np.random.default_rng(seed))
    save_map(map_file, brain, {"recordings": [str(file) for file in files]})
    typer.echo(
        f"{map_file}: {brain.clusterer.size} situations, {brain.transitions} transitions"
        f" from {driven} commands"
    )
