"""Commands that drive a robot live, or look through its camera."""

from pathlib import Path
from typing import Annotated

import typer
from khepera_protocol.config_file import add_config
from khepera_protocol.logs import LogOptions, set_up_log
from khepera_protocol.options import Cli, takes
from khepera_protocol.zenoh.config import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT
from khepera_protocol.zenoh.controller_payloads import Decision
from pydantic import Field
from rich.console import Console
from rich.table import Table

from macor_hil.cli.common import decision_line, hardware_of, session_of
from macor_hil.cli.ending import Status, kept, told
from macor_hil.cli.learning import train_map_of
from macor_hil.cli.paths import PICTURES, check_file, check_folder
from macor_hil.errors import MacorError
from macor_hil.hardware.cameras.checked_camera import AHEAD, CheckedCamera, limits_of
from macor_hil.hardware.options import DeviceOptions, ProfileOptions, ZenohOptions
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.mind.map_file import load_map
from macor_hil.mind.options import AllowOptions, MindOptions
from macor_hil.monitor.pictures import draw_ahead, draw_trials, draw_view
from macor_hil.runs.demo import (
    HARDER,
    PLANNER_IN_HARDER,
    DemoSettings,
    reserved,
    run_demo,
)
from macor_hil.runs.live_run import serve
from macor_hil.runs.options import RunOptions, TrainOptions
from macor_hil.runs.run_reporter import RunReport
from macor_hil.telemetry.wishes.stop_key import ask_to_stop

app = typer.Typer()
add_config(app, "run")


class LookOptions(AllowOptions, ProfileOptions, DeviceOptions):
    """A look through a camera."""

    picture: Path = Field(default=Path("runs/view.png"), description="PNG file to draw.")
    map_file: Annotated[Path | None, Cli(flags=("--map",))] = Field(
        default=None, description="Map whose tuned receptive fields to use."
    )


class SaidOptions(LogOptions):
    """The words of a live run."""

    quiet: Annotated[bool, Cli(flags=("--quiet",))] = Field(
        default=False, description="Print no line for each decision."
    )


class StopOptions(ZenohOptions):
    """A controller that is to stop its robot."""

    connect: Annotated[tuple[str, ...], Cli(metavar="ENDPOINT")] = Field(
        default=(CONTROLLER_ENDPOINT,), description="Zenoh peers, there now or later."
    )


@app.command(
    epilog="[cyan]macor-hil run --port runs/khepera --camera zenoh --map runs/corridor.npz[/cyan]"
)
@takes(RunOptions, SaidOptions)
def run(options: RunOptions, said: SaidOptions) -> None:
    """Drive a robot live by a map, publishing frames and decisions over Zenoh.

    With --goal it is driven to what the camera saw somewhere in training, such as red walls or a
    lamp, and ends there with exit status 0; an along: goal is kept to up to the last command.

    The robot is always stopped before the program ends: after the last command, a collision,
    Ctrl-C, SIGTERM, a closed terminal or an error, or when nobody reads what is printed. When robot
    or camera fail, it is stopped, and the run goes on once both work again. With --commands 0,
    --after-collision back-off, --wait inf and --recovery inf it goes on until it is told to end.
    Exit status 3 after a collision, 4 where robot or camera are lost.
    """
    set_up_log(said)
    report = serve(options, _ignored if said.quiet else _printed)
    driven = _driven(report)
    if report.signal:
        with kept(lambda: driven):
            raise KeyboardInterrupt
    typer.echo(f"{report.ending}: {driven}")
    if report.collided:
        raise typer.Exit(Status.COLLISION)


def _printed(decision: Decision) -> None:
    told(decision_line(decision))


def _ignored(_: Decision) -> None:
    """Print nothing."""


def _driven(report: RunReport) -> str:
    """Return a report in words."""
    parts = [f"{report.commands} commands, reinforcement {report.reinforcement:.2f}"]
    if report.recoveries:
        parts.append(f"recovered from {report.recoveries} failures")
    if report.collisions > report.collided:
        parts.append(f"{report.collisions} collisions")
    if report.learned:
        parts.append(f"{report.learned} commands learned while driving")
    return "; ".join([*parts, "the robot stands"])


@app.command(epilog="[cyan]macor-hil stop --connect tcp/127.0.0.1:7448[/cyan]")
@takes(StopOptions)
def stop(options: StopOptions) -> None:
    """Ask the controller of a robot to stop it; it must have been started with --stop-key."""
    with session_of(options) as session:
        ask_to_stop(session, options.robot)
    typer.echo(f"the controller of {options.robot} is stopping it")


@app.command(epilog="[cyan]macor-hil look --picture view.png[/cyan]")
@takes(LookOptions)
def look(options: LookOptions) -> None:
    """Draw what the robot sees now: mirror image, panorama, receptive fields.

    A robot's own camera (--camera own) looks ahead and has no more than its picture.
    """
    check_file("--picture", options.picture, PICTURES)
    if options.camera_address.needs_client:
        with hardware_of(options) as hardware:
            draw_ahead(options.picture, CheckedCamera(hardware.camera, AHEAD).grab().image)
        typer.echo(str(options.picture))
        return
    map_file = options.map_file
    brain = load_map(map_file, options.allow)[0] if map_file else build_brain()
    if mirror := options.measured().mirror:
        brain.eyes.look_through(mirror)
    if not isinstance(brain.eyes, PanoramaEyes):
        raise MacorError(f"the eyes of {map_file} have no receptive fields to draw")
    with hardware_of(options) as hardware:
        eyes = CheckedCamera(hardware.camera, limits_of(brain.eyes))
        draw_view(options.picture, brain.eyes, eyes.grab().image)
    typer.echo(str(options.picture))


@app.command(epilog="[cyan]macor-hil demo --folder runs[/cyan]")
def demo(
    folder: Annotated[Path, typer.Option(help="For the map and the picture.")] = Path("runs"),
    speed: Annotated[
        float, typer.Option(min=0.1, max=20.0, help="Time runs so many times faster.")
    ] = 1.0,
) -> None:
    """Train a map if there is none, then drive the curve live with each planner, and a maze.

    Ends with a table and pictures; exit status 0 if the planning robots got through and the
    reactive one did not, 1 otherwise. Where another one runs on this machine, it takes other
    endpoints, and says how to watch it.
    """
    check_folder("--folder", folder)
    map_file, picture = folder / "corridor.npz", folder / "trajectories.png"
    with reserved(DEFAULT_ENDPOINT) as emulator, reserved(CONTROLLER_ENDPOINT) as controller:
        settings = DemoSettings(map_file, speed, emulator=emulator, controller=controller)
        if not map_file.exists():
            typer.echo(f"training {map_file} in virtual time (the robot itself would take hours)")
            typer.echo(f"watch it from another terminal: macor-hil dashboard{settings.watching}")
            training = TrainOptions(
                port=settings.training_port,
                map_file=map_file,
                seed=settings.seed,
                listen=(settings.emulator,),
            )
            train_map_of(training, MindOptions())
        typer.echo(
            "driving live; watch from another terminal: macor-hil dashboard"
            f"{settings.watching}, or monitor"
        )
        with kept(lambda: f"the map is in {map_file}; the same command drives by it anew"):
            result = run_demo(
                settings, lambda name, decision: told(f"{name:12} {decision_line(decision)}")
            )
    pictures = [picture]
    draw_trials(picture, {name: (result.outline, one) for name, one in result.trials.items()})
    rows = [(name, settings.arena, trial) for name, trial in result.trials.items()]
    if result.harder is None:
        typer.echo(f"{map_file} is older than the planner for the {HARDER}; take it away to see it")
    else:
        outline, trial = result.harder
        pictures.append(folder / f"{HARDER}.png")
        draw_trials(pictures[-1], {PLANNER_IN_HARDER: (outline, trial)})
        rows.append((PLANNER_IN_HARDER, HARDER, trial))
    table = Table("planner", "arena", "commands", "reinforcement", "collision")
    for name, arena, trial in rows:
        end = "yes" if trial.collided else "no"
        table.add_row(name, arena, str(trial.length), f"{trial.total:.2f}", end)
    Console().print(table)
    typer.echo(f"pictures: {', '.join(map(str, pictures))}")
    if not result.as_expected:
        typer.echo("not as expected: the planning robots should get through, the reactive one not")
        raise typer.Exit(Status.NO)
