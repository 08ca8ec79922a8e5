"""Commands that score planners, and reproduce the paper's experiments."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from khepera_protocol.options import Cli, takes
from khepera_protocol.zenoh.payloads import Reset
from pydantic import Field
from rich import box
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Table
from rich.text import Text

from macor_hil.cli.common import extra, hardware_of, progress_bar
from macor_hil.cli.ending import kept
from macor_hil.cli.paths import check_folder
from macor_hil.errors import MacorError
from macor_hil.hardware.bench import Bench
from macor_hil.hardware.driver import Driver, DriveSettings
from macor_hil.hardware.options import Options
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import PLANNERS, memory_for
from macor_hil.mind.map_file import load_map
from macor_hil.mind.options import PartSettings, PlannerNames
from macor_hil.mind.planners.planner import Aiming, Planner
from macor_hil.runs.agent import Agent
from macor_hil.runs.options import TrialOptions
from macor_hil.runs.possible import Possible, compare, judge, said_of_starts
from macor_hil.runs.trials import Spread, Trial, run_trial
from macor_hil.safety.interruption import signals_taken_over

app = typer.Typer()


class ScoredPlanners(PartSettings):
    """Planners that are scored."""

    planner: Annotated[
        PlannerNames, Cli(names=PLANNERS.names, show_default="all without a goal")
    ] = Field(
        default=(), description="Planner; give several: {names}; or module:Class, file.py:Class."
    )

    def names_for(self, brain: Brain) -> list[str]:
        """List the planners, or all whose memory a brain has, but for those that drive to a goal.

        Raises:
            MacorError: there is no such planner, a setting is wrong, or its memory is missing.
        """
        names = self.planner or PLANNERS.names()
        made = list(zip(names, self.make_planners(names), strict=True))
        for _, planner in made if self.planner else ():
            memory_for(brain, planner)
        return [
            name
            for name, planner in made
            if planner.memory in brain.memories
            and (self.planner or not isinstance(planner, Aiming))
        ]


class ReproduceOptions(Options):
    """An experiment over many training seeds."""

    name: Annotated[str, Cli(argument=True)] = Field(
        description="figure2 to figure5 or table1 of the paper; conditions, sensitivity, beyond,"
        " goals, destinations, drift, arenas, amounts, ablation; peers, which needs the extra of"
        " that name; or all but peers."
    )
    seeds: int = Field(default=30, ge=1, description="Training seeds: 1 to this number.")
    workers: Annotated[int | None, Cli(show_default="one for each processor")] = Field(
        default=None, ge=1, description="Processes to share the work."
    )
    cluster: Annotated[str | None, Cli(metavar="ADDRESS")] = Field(
        default=None,
        description="Scheduler of a dask cluster that does the work instead, such as"
        " tcp://127.0.0.1:8786; its workers share the folder of --out.",
    )
    planner: Annotated[PlannerNames, Cli(names=PLANNERS.names)] = Field(
        default=(),
        description="A planner that gets a row of its own in table 1: {names}, module:Class or"
        " file.py:Class. It reads a memory that the table's systems learn.",
    )
    out: Path = Field(
        default=Path("runs/reproduction"), description="For recordings, results and the report."
    )
    kept: Annotated[bool, Cli(flags=("--kept",))] = Field(
        default=False,
        description="Drive nothing: write the report of what is done so far, also while another"
        " process goes on.",
    )
    quick: bool = Field(
        default=False,
        description="Shorter trainings, fewer trials and arenas: minutes, to see whether all is"
        " well.",
    )
    arena: Annotated[str | None, Cli(metavar="NAME|FILE")] = Field(
        default=None,
        description="Train and drive in this arena instead, where an experiment has one.",
    )
    settings: Annotated[tuple[str, ...], Cli(flags=("--set",), metavar="NAME=VALUE")] = Field(
        default=(),
        description="A setting of the experiment, such as drive.random=2000, nodes=30 or"
        " course.trials=3.",
    )


@app.command(epilog="[cyan]macor-hil trials --map runs/corridor.npz --trials 20[/cyan]")
@takes(TrialOptions, ScoredPlanners)
def trials(options: TrialOptions, scored: ScoredPlanners) -> None:
    """Score planners on a map: trials of 40 commands at most, from starts near the arena's own.

    Possible: the share of the commands that can be driven from the same start without a
    collision, as a search over the arena's floor plan tells. Needless: collisions where none was
    necessary. Ctrl-C shows the trials driven so far.
    """
    brain, _ = load_map(options.map_file, options.allow)
    names = scored.names_for(brain)
    of = options.trials * len(names)
    results: dict[str, list[Trial]] = {}
    possible: list[Possible] = []

    def driven() -> str:
        done = sum(map(len, results.values()))
        return f"{done} of {of} trials were driven; the same command begins anew"

    try:
        with (
            kept(driven),
            signals_taken_over() as interruption,
            hardware_of(options) as hardware,
            progress_bar(of) as progress,
        ):
            bench = hardware.bench
            if bench is None:
                raise MacorError(f"trials need an emulated robot, which {options.port} is not")
            possible_from = judge(bench)
            drive = DriveSettings(speed=options.speed)
            driver = Driver(hardware.robot, drive, interruption.check, patient=True)
            agent = Agent(brain, driver, hardware.camera)
            for name in names:
                of_planner = results.setdefault(name, [])
                for k in range(options.trials):
                    (planner,) = scored.make_planners([name])
                    of_planner.append(_trial(agent, planner, bench, [options.seed, k]))
                    if k == len(possible):  # every planner has the same starts
                        possible.append(possible_from(of_planner[k].path[0]))
                    progress(sum(map(len, results.values())))
    finally:
        _show(results, possible)


def _trial(agent: Agent, planner: Planner, bench: Bench, seed: list[int]) -> Trial:
    rng = np.random.default_rng(seed)
    start = bench.reset(Reset(seed=int(rng.integers(2**31)))).pose
    pose = Spread().draw(start, rng)
    return run_trial(agent, planner, bench, Reset(pose=pose), rng)


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
        typer.echo(said_of_starts(possible))


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


@app.command(epilog="[cyan]macor-hil reproduce table1 --seeds 10[/cyan]")
@takes(ReproduceOptions)
def reproduce(options: ReproduceOptions) -> None:
    """Run an experiment of the paper over many training seeds, and write a report page.

    What is done stays done: a run that was interrupted goes on when started again. All trials are
    rows of a CSV file beside the report.
    """
    with (
        kept(lambda: _how_to_go_on(options.out)),
        _progress() as bars,
    ):
        bars.add_task(f"reproduce {options.name}", total=None)
        with extra("experiments"):
            from macor_hil.experiments import catalogue
            from macor_hil.experiments.sweep import changes, runner
        chosen = catalogue.find(options.name)
        if options.quick:
            chosen = changes.quick(chosen)
        if options.arena is not None:
            chosen = changes.in_arena(chosen, options.arena)
        chosen = changes.with_settings(chosen, options.settings)
        chosen = catalogue.with_planners(chosen, options.planner)
        check_folder("--out", options.out)
        watch = _Watch(bars)
        if options.kept:
            page = runner.report(chosen, options.seeds, options.out, watch)
        else:
            workers = options.workers or runner.ALL
            page = runner.reproduce(
                chosen, options.seeds, workers, options.out, watch, options.cluster
            )
    typer.echo(str(page))


def _how_to_go_on(out: Path) -> str:
    command = shlex.join(["macor-hil", *sys.argv[1:]])
    return f"what is done is kept in {out}; go on with: {command}"


class _Count(MofNCompleteColumn):
    """Column of done and total; empty where the total is not known."""

    def render(self, task: Task) -> Text:
        """Return the text of a task."""
        return Text() if task.total is None else super().render(task)


def _progress() -> Progress:
    """Return bars that move by themselves; where there is no terminal, none are shown."""
    console = Console(stderr=True)
    columns = SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), _Count()
    return Progress(*columns, TimeElapsedColumn(), console=console, disable=not console.is_terminal)


class _Watch:
    """Shows a bar for each piece of work; where there is no terminal, a line for each step."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}

    def __call__(self, what: str, done: int, of: int) -> None:
        """Show how much is done."""
        if done == 0:
            self._tasks[what] = self._bars.add_task(what, total=of)
        self._bars.update(self._tasks[what], completed=done)
        if not self._bars.console.is_terminal:
            self._bars.console.print(f"{what}: {done} of {of}")
