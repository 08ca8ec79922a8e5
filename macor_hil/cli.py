"""Command line of the controller: `macor-hil`."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from macor_hil.agent import Agent
from macor_hil.brain import Brain, Settings
from macor_hil.checkpoints import checkpoint_path, train_map
from macor_hil.demo import DEFAULT_SEED, DemoSettings, run_demo
from macor_hil.drive import Driver
from macor_hil.errors import MacorError, MapError
from macor_hil.hardware import Hardware, is_embedded, open_hardware
from macor_hil.map_file import load_map
from macor_hil.monitor.terminal import watch
from macor_hil.pictures import draw_trials, draw_view
from macor_hil.planners import PLANNERS
from macor_hil.service import ServiceConfig, serve
from macor_hil.telemetry.schemas import Decision
from macor_hil.telemetry.session import open_session
from macor_hil.training import Recovery, Schedule
from macor_hil.trials import Spread, Trial, run_trial
from protocol.side_channel import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT, Reset

_FAILED: Final = 2
_INTERRUPTED: Final = 130

_EXAMPLES = """[bold]Examples[/bold]

Train a map on the emulated robot, in virtual time:
[cyan]macor-hil train --map runs/corridor.npz[/cyan]

Score both planners on it:
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

_COLUMNS = (
    TextColumn("{task.description}"),
    BarColumn(),
    MofNCompleteColumn(),
    TimeRemainingColumn(),
)

_DEFAULT_PORT = f"khepera://corridor?seed={DEFAULT_SEED}"
_DEFAULT_MAP = Path("runs/corridor.npz")

PortOption = Annotated[
    str, typer.Option(help="Serial device or pySerial URL; khepera://ARENA is a robot in-process.")
]
CameraOption = Annotated[
    str, typer.Option(help="auto, port, zenoh\\[:KEY], video:DEVICE or video:FILE.")
]
BaudOption = Annotated[int, typer.Option(min=1, help="Rate of the serial line, bits a second.")]
MapOption = Annotated[Path, typer.Option("--map", help="Map file.")]
RobotOption = Annotated[str, typer.Option(metavar="NAME", help="The robot's name in Zenoh keys.")]
ConnectOption = Annotated[
    list[str], typer.Option(metavar="ENDPOINT", help="Zenoh peers, there now or later.")
]
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
    map_file: MapOption = _DEFAULT_MAP,
    seed: SeedOption = DEFAULT_SEED,
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
    robot: RobotOption = "khepera",
    connect: ConnectOption = [DEFAULT_ENDPOINT],  # noqa: B006
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
    with (
        _hardware(port, camera, baud, robot, connect) as hardware,
        _progress(schedule.commands) as progress,
    ):
        devices = Driver(hardware.robot), hardware.camera, hardware.bench
        brain = train_map(map_file, settings, schedule, port, devices, progress)
    typer.echo(
        f"{map_file}: {brain.art.size} situations, {np.count_nonzero(brain.map.z)} transitions"
        f" from {schedule.commands} commands"
    )


@app.command(epilog="[cyan]macor-hil trials --map runs/corridor.npz --trials 20[/cyan]")
def trials(
    map_file: MapOption = _DEFAULT_MAP,
    port: PortOption = _DEFAULT_PORT,
    planner: Annotated[
        list[str] | None, typer.Option(help="Planner; give several. Default: all.")
    ] = None,
    count: Annotated[int, typer.Option("--trials", min=1, help="Trials of each planner.")] = 10,
    seed: SeedOption = DEFAULT_SEED,
) -> None:
    """Score planners on a map: trials of 40 commands at most, from starts near the arena's own."""
    brain, _ = load_map(map_file)
    names = planner or list(PLANNERS)
    table = Table("planner", "trials", "commands", "reinforcement", "collided", "touched")
    with (
        _hardware(port, "auto", 9600, "khepera", [DEFAULT_ENDPOINT]) as hardware,
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


@app.command(
    epilog="[cyan]macor-hil run --port runs/khepera --camera zenoh --map runs/corridor.npz[/cyan]"
)
def run(
    port: PortOption = _DEFAULT_PORT,
    camera: CameraOption = "auto",
    map_file: MapOption = _DEFAULT_MAP,
    planner: Annotated[
        str, typer.Option(help=f"How to choose commands: {' or '.join(PLANNERS)}.")
    ] = "anticipative",
    commands: Annotated[int, typer.Option(min=1, help="Commands to drive at most.")] = 40,
    baud: BaudOption = 9600,
    robot: RobotOption = "khepera",
    listen: Annotated[
        list[str], typer.Option(metavar="ENDPOINT", help="Where watchers find this controller.")
    ] = [CONTROLLER_ENDPOINT],  # noqa: B006 - typer copies it
    connect: ConnectOption = [DEFAULT_ENDPOINT],  # noqa: B006
    seed: SeedOption = DEFAULT_SEED,
) -> None:
    """Drive a robot live by a map, publishing frames and decisions over Zenoh.

    The robot is stopped on every way out: the last command, a collision, Ctrl-C, SIGTERM, an
    error.
    """
    config = ServiceConfig(
        port=port,
        map_file=map_file,
        camera=camera,
        baud=baud,
        planner=planner,
        commands=commands,
        robot=robot,
        listen=tuple(listen),
        connect=tuple(connect),
        seed=seed,
    )
    report = serve(config, lambda decision: typer.echo(_line(decision)))
    typer.echo(
        f"{report.ending}: {report.commands} commands, reinforcement {report.reinforcement:.2f};"
        " the robot stands"
    )
    if report.signal:
        sys.exit(_INTERRUPTED)


@app.command(epilog="[cyan]macor-hil look --picture view.png[/cyan]")
def look(
    picture: Annotated[Path, typer.Option(help="PNG file to draw.")] = Path("runs/view.png"),
    port: PortOption = _DEFAULT_PORT,
    camera: CameraOption = "auto",
    map_file: Annotated[
        Path | None, typer.Option("--map", help="Map whose tuned receptive fields to use.")
    ] = None,
    baud: BaudOption = 9600,
    robot: RobotOption = "khepera",
    connect: ConnectOption = [DEFAULT_ENDPOINT],  # noqa: B006
) -> None:
    """Draw what the robot sees now: mirror image, panorama, receptive fields."""
    brain = load_map(map_file)[0] if map_file else Brain(Settings())
    with _hardware(port, camera, baud, robot, connect) as hardware:
        draw_view(picture, brain, hardware.camera.grab().image)
    typer.echo(str(picture))


@app.command(epilog="[cyan]macor-hil monitor --connect tcp/127.0.0.1:7448[/cyan]")
def monitor(
    robot: RobotOption = "khepera",
    connect: ConnectOption = [CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT],  # noqa: B006
) -> None:
    """Watch a controller in the terminal; a Zenoh subscriber and nothing else."""
    watch(robot, [], connect)


@app.command(epilog="[cyan]macor-hil demo --folder runs[/cyan]")
def demo(
    folder: Annotated[Path, typer.Option(help="For the map, the picture and the port.")] = Path(
        "runs"
    ),
    speed: Annotated[
        float, typer.Option(min=0.1, max=20.0, help="Time runs so many times faster.")
    ] = 1.0,
) -> None:
    """Train a map if there is none, then drive the curve live with both planners.

    Ends with a table and a picture; exit status 0 if the planning robot got round the curve and the
    reactive one did not, 1 otherwise.
    """
    map_file = folder / "corridor.npz"
    settings = DemoSettings(map_file=map_file, link=folder / "khepera", speed=speed)
    if not map_file.exists():
        typer.echo(f"training {map_file} in virtual time (the robot itself would take hours)")
        train(port=settings.training_port, map_file=map_file, seed=settings.seed)
    typer.echo("driving live; watch from another terminal with: macor-hil monitor")
    result = run_demo(settings, lambda name, decision: typer.echo(f"{name:12} {_line(decision)}"))
    picture = folder / "trajectories.png"
    draw_trials(picture, result.outline, result.trials)
    table = Table("planner", "commands", "reinforcement", "collision", "picture")
    for name, trial in result.trials.items():
        end = "yes" if trial.collided else "no"
        table.add_row(name, str(trial.length), f"{trial.total:.2f}", end, str(picture))
    Console().print(table)
    if not result.as_expected:
        typer.echo("not as expected: the planning robot should get round, the reactive one not")
        sys.exit(1)


@app.command(epilog="[cyan]macor-hil reproduce table1 --seeds 10 --workers 2[/cyan]")
def reproduce(
    name: Annotated[str, typer.Argument(help="A figure or table of the paper, or all.")],
    seeds: Annotated[int, typer.Option(min=1, help="Training seeds: 1 to this number.")] = 30,
    workers: Annotated[int, typer.Option(min=1, help="Processes to share the work.")] = 1,
    out: Annotated[Path, typer.Option(help="For recordings, results and the report.")] = Path(
        "runs/reproduction"
    ),
) -> None:
    """Run an experiment of the paper over many training seeds, and write a report page.

    What is done stays done: a run that was interrupted goes on when started again.
    """
    try:
        from macor_hil.experiments import catalogue, runner
    except ImportError as error:
        raise MacorError(
            f"{error.name} is not installed; install the extra 'experiments'"
        ) from None
    chosen = catalogue.find(name)
    with Progress(*_COLUMNS, console=Console(stderr=True)) as bars:
        tasks: dict[str, TaskID] = {}

        def watch(what: str, done: int, of: int) -> None:
            if done == 0:
                tasks[what] = bars.add_task(what, total=of)
            bars.update(tasks[what], completed=done)

        page = runner.reproduce(chosen, seeds, workers, out, watch)
    typer.echo(str(page))


def _line(decision: Decision) -> str:
    values = "  ".join(
        f"{a.command} {'  -  ' if a.evaluation is None else f'{a.evaluation:5.2f}'}"
        for a in decision.alternatives
    )
    end = "  COLLISION" if decision.collided else ""
    return (
        f"{decision.sequence:3}  situation {decision.situation.node:2}  {values}"
        f"  -> {decision.command:8}  r {decision.reinforcement:.2f}{end}"
    )


@contextmanager
def _hardware(
    port: str, camera: str, baud: int, robot: str, connect: list[str]
) -> Iterator[Hardware]:
    """The hardware, with a Zenoh session where camera or bench are reached over one."""
    with ExitStack() as stack:
        session = None
        if camera.startswith("zenoh") or (camera == "auto" and not is_embedded(port)):
            session = stack.enter_context(open_session([], connect))
        yield stack.enter_context(
            open_hardware(port, camera, baud=baud, session=session, name=robot)
        )


@contextmanager
def _progress(total: int) -> Iterator[Callable[[int], None]]:
    with Progress(*_COLUMNS, console=Console(stderr=True)) as bar:
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
