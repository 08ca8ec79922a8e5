"""Commands that measure a robot and write what they find into its profile."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite, nan
from pathlib import Path
from typing import Annotated, Final

import cv2
import typer
from khepera_protocol.mirror import Mirror
from khepera_protocol.options import Cli, takes
from pydantic import Field

from macor_hil.arrays import Image
from macor_hil.cli.common import camera_of, progress_bar, session_of
from macor_hil.cli.ending import kept
from macor_hil.cli.paths import PICTURES, check_file
from macor_hil.errors import CalibrationError, CameraError, MacorError
from macor_hil.hardware.address import DEFAULT_SEED
from macor_hil.hardware.bench import Bench, PortBench, ZenohBench
from macor_hil.hardware.calibration.course import drive_all, fit_wheels, moves
from macor_hil.hardware.calibration.measured import CalibrationPlan, Measured, measured_path
from macor_hil.hardware.calibration.measuring import BenchRuler, Hands, Ruler
from macor_hil.hardware.cameras.checked_camera import CheckedCamera, PictureLimits, limits_for
from macor_hil.hardware.cameras.mirror_fit import draw_mirror, find_mirror
from macor_hil.hardware.devices import robot_at
from macor_hil.hardware.driver import Driver, DriveSettings
from macor_hil.hardware.odometry import Wheels
from macor_hil.hardware.options import DeviceOptions, LineOptions, SpeedOptions, ZenohOptions
from macor_hil.hardware.profile import change_profile, load_profile
from macor_hil.hardware.robots.robot import Robot
from macor_hil.safety.claim import claim
from macor_hil.safety.interruption import signals_taken_over

DEFAULT_PROFILE: Final = Path("runs/robot.json")

_FREE_FLOOR: Final = f"khepera://open-box?seed={DEFAULT_SEED}"
"""Arena in which the default course fits."""

app = typer.Typer()

_ProfileFile = Annotated[Path, Cli(flags=("--profile",), metavar="FILE")]


class CameraOptions(DeviceOptions):
    """A camera, and the mirror in its picture."""

    calibrate: Annotated[bool, Cli(flags=("--calibrate",))] = Field(
        default=False,
        description="Find the mirror's centre and rims, and write them into --profile.",
    )
    centre: Annotated[str | None, Cli(metavar="X,Y")] = Field(
        default=None, description="The mirror's centre, instead of a search."
    )
    inner: float | None = Field(
        default=None, ge=0.0, description="Radius of its inner rim, pixels."
    )
    outer: float | None = Field(
        default=None, ge=1.0, description="Radius of its outer rim, pixels."
    )
    profile: _ProfileFile = Field(default=DEFAULT_PROFILE, description="Robot's profile.")
    picture: Path = Field(
        default=Path("runs/mirror.png"),
        description="PNG file to draw the mirror into, as it is described.",
    )


class CalibrateOptions(SpeedOptions, ZenohOptions, LineOptions):
    """A calibration of the wheels."""

    port: str = Field(default=_FREE_FLOOR, description="Serial device or pySerial URL.")
    side: float = Field(default=0.5, ge=0.05, le=5.0, description="Side of the square, metres.")
    runs: int = Field(default=5, ge=1, le=100, description="How often each move is driven.")
    emulated: Annotated[bool, Cli(flags=("--emulated",))] = Field(
        default=False, description="Let the emulator at --connect put the robot and measure it."
    )
    profile: _ProfileFile = Field(default=DEFAULT_PROFILE, description="Robot's profile.")
    restart: Annotated[bool, Cli(flags=("--restart",))] = Field(
        default=False, description="Begin anew, even with measured moves there."
    )


@app.command(epilog="[cyan]macor-hil camera --camera video:0 --calibrate[/cyan]")
@takes(CameraOptions)
def camera(options: CameraOptions) -> None:
    """Look through a camera: is its picture usable, and where does the mirror lie in it?

    Draws the picture with the mirror's rims and straight ahead, to be looked at.
    """
    picture, profile = options.picture, options.profile
    check_file("--picture", picture, PICTURES)
    if options.calibrate:
        check_file("--profile", profile)
    elif (options.centre, options.inner, options.outer) != (None, None, None):
        raise MacorError(
            "--centre, --inner and --outer describe a mirror for --calibrate, which is not there"
        )
    with camera_of(options) as eyes:
        if options.calibrate:
            image = CheckedCamera(eyes, PictureLimits()).grab().image
            mirror = _given(image, options) or find_mirror(image)
            note = f"{image.shape[1]} x {image.shape[0]} pixels from the camera {options.camera}"
            change_profile(profile, ("mirror", note), mirror=mirror)
        else:
            mirror = (load_profile(profile).mirror if profile.exists() else None) or Mirror()
            image = _usable(CheckedCamera(eyes, limits_for(mirror)))
    picture.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(picture), draw_mirror(image, mirror)):
        raise CameraError(f"cannot write the picture {picture}")
    found = f"written to {profile}" if options.calibrate else "usable"
    typer.echo(
        f"centre {mirror.centre_x:g}, {mirror.centre_y:g}; inner rim {mirror.inner:g}, outer rim"
        f" {mirror.outer:g} pixels; {found}; look at {picture}"
    )


@app.command(epilog="[cyan]macor-hil calibrate --port /dev/ttyUSB0 --side 0.5 --runs 5[/cyan]")
@takes(CalibrateOptions)
def calibrate(options: CalibrateOptions) -> None:
    """Measure the wheels: drive marked moves, fit the way of a count and the wheel base.

    A straight line, squares and turns on the spot need a free, even floor somewhat larger than the
    square. Before each move you put the robot on its mark, after it you are asked where it stands;
    a robot behind a khepera:// port is put and measured by its emulator. What was measured is kept:
    a calibration that was interrupted goes on when started again.
    """
    profile = options.profile
    check_file("--profile", profile)
    known = load_profile(profile).wheels if profile.exists() else Wheels()
    with claim(profile):
        if options.restart:
            measured_path(profile).unlink(missing_ok=True)
        course = CalibrationPlan(options.port, options.side, options.runs, options.speed, known)
        done = Measured(profile, course)
        _drive_what_is_left(options, done)
    try:
        found = fit_wheels(done.runs, known)
    except CalibrationError as error:
        raise CalibrationError(
            f"{error}; the moves are in {done.path}, --restart begins anew"
        ) from None
    note = (
        f"{len(done.runs)} moves, side {options.side:g} m; ends {1000 * found.before:.1f} mm from"
        f" odometry before, {1000 * found.after:.1f} mm after (root mean square)"
    )
    change_profile(profile, ("wheels", note), wheels=found.wheels)
    done.close()
    typer.echo(
        f"right wheel over left {found.ratio:.5f} ± {found.ratio_error:.5f}; base"
        f" {1000 * found.wheels.base:.3f} ± {1000 * found.base_error:.3f} mm; {note}; written to"
        f" {profile}"
    )


def _drive_what_is_left(options: CalibrateOptions, done: Measured) -> None:
    """Drive and measure the moves that have not been measured yet."""
    plan, known = moves(options.side), done.course.wheels
    total = options.runs * len(plan)
    with (
        kept(lambda: _what_is_kept(done, total)),
        signals_taken_over() as interruption,
        robot_at(options) as robot,
        _bench_of(options, robot) as bench,
        progress_bar(total) as progress,
    ):
        progress(len(done.runs))
        ruler: Ruler = Hands(progress.say, progress.ask)
        if bench is not None:
            ruler = BenchRuler(bench, len(done.runs))
        settings = DriveSettings(wheels=known, speed=options.speed)
        driver = Driver(robot, settings, interruption.check)
        places = ruler.place, ruler.measure
        for run in drive_all(driver, plan, options.runs, *places, len(done.runs)):
            done.add(run)
            progress(len(done.runs))


@contextmanager
def _bench_of(options: CalibrateOptions, robot: Robot) -> Iterator[Bench | None]:
    """Open the bench of an emulated robot; None for others."""
    if options.address.embedded:
        yield PortBench(robot.port)
    elif options.emulated:
        with session_of(options) as session:
            yield ZenohBench(session, options.robot)
    else:
        yield None


def _what_is_kept(done: Measured, of: int) -> str:
    if not done.runs:
        return "no move was measured"
    return (
        f"{len(done.runs)} of {of} moves are kept in {done.path}; the same command goes on from"
        " there"
    )


def _usable(camera: CheckedCamera) -> Image:
    """Take a picture that can be acted upon; of a live camera a second one, so that ice shows."""
    image = camera.grab().image
    return camera.grab().image if camera.live else image


def _given(image: Image, options: CameraOptions) -> Mirror | None:
    """Return the mirror that was measured by hand, or None."""
    centre, inner, outer = options.centre, options.inner, options.outer
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
