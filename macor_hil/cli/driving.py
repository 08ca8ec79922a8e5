"""Commands that drive a robot live, or look through its camera."""

from pathlib import Path
from typing import Annotated, Final

import typer
from khepera_protocol.zenoh.payloads import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT
from rich.console import Console
from rich.table import Table

from macor_hil.cli.ending import Status, kept, told
from macor_hil.cli.learning import train
from macor_hil.cli.options import (
    DEFAULT_MAP,
    DEFAULT_PORT,
    BaudOption,
    CameraOption,
    ConnectOption,
    InfraredOption,
    MapOption,
    PortOption,
    ProfileOption,
    RobotOption,
    SeedOption,
    SpeedOption,
    ZenohConfigOption,
    decision_line,
    hardware_of,
)
from macor_hil.cli.paths import PICTURES, check_file, check_folder
from macor_hil.errors import MacorError
from macor_hil.hardware.cameras.checks import CheckedCamera, limits_of
from macor_hil.hardware.cameras.watchdog import DEFAULT_LIMIT
from macor_hil.hardware.driver import DriveSettings
from macor_hil.hardware.profile import load_profile
from macor_hil.mind.catalogue import PLANNERS, build_brain
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.mind.map_file import load_map
from macor_hil.monitor.pictures import draw_trials, draw_view
from macor_hil.runs.demo import (
    DEFAULT_SEED,
    HARDER,
    PLANNER_IN_HARDER,
    DemoSettings,
    reserved,
    run_demo,
)
from macor_hil.runs.service import ServiceConfig, serve
from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.stop_key import ask_to_stop

_DRIVE: Final = DriveSettings()

app = typer.Typer()


@app.command(
    epilog="[cyan]macor-hil run --port runs/khepera --camera zenoh --map runs/corridor.npz[/cyan]"
)
def run(
    port: PortOption = DEFAULT_PORT,
    camera: CameraOption = "auto",
    map_file: MapOption = DEFAULT_MAP,
    planner: Annotated[
        str,
        typer.Option(
            help=f"How to choose commands: {', '.join(PLANNERS.names())}; or file.py:Class."
        ),
    ] = "anticipative",
    commands: Annotated[int, typer.Option(min=1, help="Commands to drive at most.")] = 40,
    baud: BaudOption = 9600,
    robot: RobotOption = "khepera",
    listen: Annotated[
        list[str], typer.Option(metavar="ENDPOINT", help="Where watchers find this controller.")
    ] = [CONTROLLER_ENDPOINT],  # noqa: B006 - typer copies it
    connect: ConnectOption = [DEFAULT_ENDPOINT],  # noqa: B006
    zenoh_config: ZenohConfigOption = None,
    stop_key: Annotated[
        bool, typer.Option("--stop-key", help="Let whoever reaches macor/NAME/stop end the run.")
    ] = False,
    profile: ProfileOption = None,
    speed: SpeedOption = _DRIVE.speed,
    infrared: InfraredOption = _DRIVE.collision,
    camera_limit: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Seconds of driving without a usable picture before the robot is stopped; 0: look"
            " only when it stands.",
        ),
    ] = DEFAULT_LIMIT,
    planner_limit: Annotated[
        float, typer.Option(min=0.01, help="Seconds of planning after which watchers are told.")
    ] = 0.5,
    recovery: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Seconds to go on trying when robot or camera fail; 0: a failure ends the run.",
        ),
    ] = 30.0,
    seed: SeedOption = DEFAULT_SEED,
) -> None:
    """Drive a robot live by a map, publishing frames and decisions over Zenoh.

    The robot is always stopped before the program ends: after the last command, a collision,
    Ctrl-C, SIGTERM, a closed terminal or an error, or when nobody reads what is printed. When robot
    or camera fail, it is stopped, and the run goes on once both work again. Exit status 3 after a
    collision.
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
        drive=DriveSettings(speed=speed, collision=infrared),
        profile=profile,
        zenoh_config=zenoh_config,
        stop_key=stop_key,
        camera_limit=camera_limit,
        planner_limit=planner_limit,
        recovery=recovery,
    )
    report = serve(config, lambda decision: told(decision_line(decision)))
    driven = (
        f"{report.commands} commands, reinforcement {report.reinforcement:.2f};"
        + (f" {report.recoveries} failures got over;" if report.recoveries else "")
        + " the robot stands"
    )
    if report.signal:
        with kept(lambda: driven):
            raise KeyboardInterrupt
    typer.echo(f"{report.ending}: {driven}")
    if report.collided:
        raise typer.Exit(Status.COLLISION)


@app.command(epilog="[cyan]macor-hil stop --connect tcp/127.0.0.1:7448[/cyan]")
def stop(
    robot: RobotOption = "khepera",
    connect: ConnectOption = [CONTROLLER_ENDPOINT],  # noqa: B006
    zenoh_config: ZenohConfigOption = None,
) -> None:
    """Ask the controller of a robot to stop it; it must have been started with --stop-key."""
    with open_session([], connect, zenoh_config) as session:
        ask_to_stop(session, robot)
    typer.echo(f"the controller of {robot} is stopping it")


@app.command(epilog="[cyan]macor-hil look --picture view.png[/cyan]")
def look(
    picture: Annotated[Path, typer.Option(help="PNG file to draw.")] = Path("runs/view.png"),
    port: PortOption = DEFAULT_PORT,
    camera: CameraOption = "auto",
    map_file: Annotated[
        Path | None, typer.Option("--map", help="Map whose tuned receptive fields to use.")
    ] = None,
    baud: BaudOption = 9600,
    robot: RobotOption = "khepera",
    connect: ConnectOption = [DEFAULT_ENDPOINT],  # noqa: B006
    zenoh_config: ZenohConfigOption = None,
    profile: ProfileOption = None,
) -> None:
    """Draw what the robot sees now: mirror image, panorama, receptive fields."""
    check_file("--picture", picture, PICTURES)
    brain = load_map(map_file)[0] if map_file else build_brain()
    if profile and (mirror := load_profile(profile).mirror):
        brain.eyes.look_through(mirror)
    if not isinstance(brain.eyes, PanoramaEyes):
        raise MacorError(f"the eyes of {map_file} have no receptive fields to draw")
    with hardware_of(port, camera, baud, robot, connect, zenoh_config) as hardware:
        eyes = CheckedCamera(hardware.camera, limits_of(brain.eyes))
        draw_view(picture, brain.eyes, eyes.grab().image)
    typer.echo(str(picture))


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
            train(
                port=settings.training_port,
                map_file=map_file,
                seed=settings.seed,
                listen=[settings.emulator],
            )
        typer.echo(
            "driving live; watch from another terminal: macor-hil dashboard"
            f"{settings.watching}, or monitor"
        )
        with kept(lambda: f"the map is in {map_file}; the same command drives by it anew"):
            result = run_demo(
                settings, lambda name, decision: told(f"{name:12} {decision_line(decision)}")
            )
    draw_trials(picture, result.outline, result.trials)
    rows = [(name, settings.arena, trial, picture) for name, trial in result.trials.items()]
    if result.harder is None:
        typer.echo(f"{map_file} is older than the planner for the {HARDER}; take it away to see it")
    else:
        outline, trial = result.harder
        draw_trials(folder / f"{HARDER}.png", outline, {PLANNER_IN_HARDER: trial})
        rows.append((PLANNER_IN_HARDER, HARDER, trial, folder / f"{HARDER}.png"))
    table = Table("planner", "arena", "commands", "reinforcement", "collision", "picture")
    for name, arena, trial, file in rows:
        end = "yes" if trial.collided else "no"
        table.add_row(name, arena, str(trial.length), f"{trial.total:.2f}", end, str(file))
    Console().print(table)
    if not result.as_expected:
        typer.echo("not as expected: the planning robots should get through, the reactive one not")
        raise typer.Exit(Status.NO)
