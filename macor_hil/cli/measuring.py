"""Commands that measure a robot and write what they find into its profile."""

from contextlib import ExitStack
from math import isfinite, nan
from pathlib import Path
from typing import Annotated, Final

import cv2
import typer
from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.payloads import DEFAULT_ENDPOINT

from macor_hil.arrays import Image
from macor_hil.cli.ending import kept
from macor_hil.cli.options import (
    DEFAULT_PORT,
    BaudOption,
    CameraOption,
    ConnectOption,
    PortOption,
    RobotOption,
    SpeedOption,
    ZenohConfigOption,
    camera_of,
    progress_bar,
)
from macor_hil.cli.paths import PICTURES, check_file
from macor_hil.errors import CalibrationError, CameraError, MacorError
from macor_hil.hardware.bench import Bench, PortBench, ZenohBench
from macor_hil.hardware.calibration.course import drive_all, fit_wheels, moves
from macor_hil.hardware.calibration.measured import Course, Measured, measured_path
from macor_hil.hardware.calibration.measuring import BenchRuler, Hands, Ruler
from macor_hil.hardware.cameras.checks import CheckedCamera, PictureLimits, limits_for
from macor_hil.hardware.cameras.mirror_fit import draw_mirror, find_mirror
from macor_hil.hardware.devices import is_embedded, robot_of
from macor_hil.hardware.driver import Driver, DriveSettings
from macor_hil.hardware.odometry import Wheels
from macor_hil.hardware.profile import change_profile, load_profile
from macor_hil.runs.demo import DEFAULT_SEED
from macor_hil.safety.claim import claim
from macor_hil.safety.interruption import signals_taken_over
from macor_hil.telemetry.session import open_session

_DRIVE: Final = DriveSettings()

DEFAULT_PROFILE: Final = Path("runs/robot.json")

_FREE_FLOOR: Final = f"khepera://open-box?seed={DEFAULT_SEED}"
"""Where the default course fits."""

app = typer.Typer()

ProfileFile = Annotated[Path, typer.Option("--profile", metavar="FILE", help="Robot's profile.")]


@app.command(epilog="[cyan]macor-hil camera --camera video:0 --calibrate[/cyan]")
def camera(
    port: PortOption = DEFAULT_PORT,
    camera: CameraOption = "auto",
    calibrate: Annotated[
        bool,
        typer.Option(
            "--calibrate", help="Find the mirror's centre and rims, and write them into --profile."
        ),
    ] = False,
    centre: Annotated[
        str | None, typer.Option(metavar="X,Y", help="The mirror's centre, instead of a search.")
    ] = None,
    inner: Annotated[
        float | None, typer.Option(min=0.0, help="Radius of its inner rim, pixels.")
    ] = None,
    outer: Annotated[
        float | None, typer.Option(min=1.0, help="Radius of its outer rim, pixels.")
    ] = None,
    profile: ProfileFile = DEFAULT_PROFILE,
    picture: Annotated[
        Path, typer.Option(help="PNG file to draw the mirror into, as it is described.")
    ] = Path("runs/mirror.png"),
    robot: RobotOption = "khepera",
    connect: ConnectOption = [DEFAULT_ENDPOINT],  # noqa: B006
    zenoh_config: ZenohConfigOption = None,
) -> None:
    """Look through a camera: is its picture usable, and where does the mirror lie in it?

    Draws the picture with the mirror's rims and straight ahead, to be looked at.
    """
    check_file("--picture", picture, PICTURES)
    if calibrate:
        check_file("--profile", profile)
    elif (centre, inner, outer) != (None, None, None):
        raise MacorError(
            "--centre, --inner and --outer describe a mirror for --calibrate, which is not there"
        )
    with camera_of(port, camera, robot, connect, zenoh_config) as eyes:
        if calibrate:
            image = CheckedCamera(eyes, PictureLimits()).grab().image
            mirror = _given(image, centre, inner, outer) or find_mirror(image)
            note = f"{image.shape[1]} x {image.shape[0]} pixels from the camera {camera}"
            change_profile(profile, ("mirror", note), mirror=mirror)
        else:
            mirror = (load_profile(profile).mirror if profile.exists() else None) or Mirror()
            image = _usable(CheckedCamera(eyes, limits_for(mirror)))
    picture.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(picture), draw_mirror(image, mirror)):
        raise CameraError(f"cannot write the picture {picture}")
    typer.echo(
        f"centre {mirror.centre_x:g}, {mirror.centre_y:g}; inner rim {mirror.inner:g}, outer rim"
        f" {mirror.outer:g} pixels; {'written to ' + str(profile) if calibrate else 'usable'};"
        f" look at {picture}"
    )


@app.command(epilog="[cyan]macor-hil calibrate --port /dev/ttyUSB0 --side 0.5 --runs 5[/cyan]")
def calibrate(
    port: PortOption = _FREE_FLOOR,
    side: Annotated[
        float, typer.Option(min=0.05, max=5.0, help="Side of the square, metres.")
    ] = 0.5,
    runs: Annotated[int, typer.Option(min=1, max=100, help="How often each move is driven.")] = 5,
    speed: SpeedOption = _DRIVE.speed,
    emulated: Annotated[
        bool,
        typer.Option(
            "--emulated", help="Let the emulator at --connect put the robot and measure it."
        ),
    ] = False,
    profile: ProfileFile = DEFAULT_PROFILE,
    baud: BaudOption = 9600,
    robot: RobotOption = "khepera",
    connect: ConnectOption = [DEFAULT_ENDPOINT],  # noqa: B006
    zenoh_config: ZenohConfigOption = None,
    restart: Annotated[
        bool, typer.Option("--restart", help="Begin anew, even with measured moves there.")
    ] = False,
) -> None:
    """Measure the wheels: drive marked moves, fit the way of a count and the wheel base.

    A straight line, squares and turns on the spot need a free, even floor somewhat larger than the
    square. Before each move you put the robot on its mark, after it you are asked where it stands;
    a robot behind a khepera:// port is put and measured by its emulator. What was measured is kept:
    a calibration that was interrupted goes on when started again.
    """
    check_file("--profile", profile)
    known = load_profile(profile).wheels if profile.exists() else Wheels()
    plan = moves(side)
    with claim(profile), ExitStack() as stack:
        if restart:
            measured_path(profile).unlink(missing_ok=True)
        done = Measured(profile, Course(port, side, runs, speed, known))
        stack.enter_context(kept(lambda: _what_is_kept(done, runs * len(plan))))
        guard = stack.enter_context(signals_taken_over()).check
        driven = stack.enter_context(robot_of(port, baud))
        bench: Bench | None = None
        if is_embedded(port):
            bench = PortBench(driven.port)
        elif emulated:
            session = stack.enter_context(open_session([], connect, zenoh_config))
            bench = ZenohBench(session, robot)
        progress = stack.enter_context(progress_bar(runs * len(plan)))
        progress(len(done.runs))
        ruler: Ruler = Hands(progress.say, progress.ask)
        if bench is not None:
            ruler = BenchRuler(bench, len(done.runs))
        driver = Driver(driven, DriveSettings(wheels=known, speed=speed), guard)
        for run in drive_all(driver, plan, runs, ruler.place, ruler.measure, len(done.runs)):
            done.add(run)
            progress(len(done.runs))
    try:
        found = fit_wheels(done.runs, known)
    except CalibrationError as error:
        raise CalibrationError(
            f"{error}; the moves are in {done.path}, --restart begins anew"
        ) from None
    note = (
        f"{len(done.runs)} moves, side {side:g} m; ends {1000 * found.before:.1f} mm from odometry"
        f" before, {1000 * found.after:.1f} mm after (root mean square)"
    )
    change_profile(profile, ("wheels", note), wheels=found.wheels)
    done.close()
    typer.echo(
        f"right wheel over left {found.ratio:.5f} ± {found.ratio_error:.5f}; base"
        f" {1000 * found.wheels.base:.3f} ± {1000 * found.base_error:.3f} mm; {note}; written to"
        f" {profile}"
    )


def _what_is_kept(done: Measured, of: int) -> str:
    if not done.runs:
        return "no move was measured"
    return (
        f"{len(done.runs)} of {of} moves are kept in {done.path}; the same command goes on from"
        " there"
    )


def _usable(camera: CheckedCamera) -> Image:
    """A picture that can be acted upon; of a live camera the second one, so that ice shows."""
    image = camera.grab().image
    return camera.grab().image if camera.live else image


def _given(
    image: Image, centre: str | None, inner: float | None, outer: float | None
) -> Mirror | None:
    """The mirror that was measured by hand, or None."""
    if centre is None and inner is None and outer is None:
        return None
    try:
        x, y = (float(word) for word in (centre or "").split(","))
    except ValueError:
        x, y = nan, nan
    given = isfinite(x + y) and inner is not None and outer is not None and isfinite(outer)
    if inner is None or outer is None or not (given and inner < outer):
        raise CameraError(
            "a mirror measured by hand needs --centre X,Y, --inner and --outer, in pixels, the"
            " inner rim smaller than the outer one"
        )
    height, width = image.shape[:2]
    return Mirror(width=width, height=height, centre_x=x, centre_y=y, inner=inner, outer=outer)
