"""The command that shows a robot to ROS 2, and lets ROS drive it."""

from typing import Annotated

import typer
from khepera_protocol.options import Cli, takes
from pydantic import Field

from macor_hil.cli.common import extra, session_of
from macor_hil.cli.watching import WatchOptions
from macor_hil.errors import MacorError
from macor_hil.hardware.options import DriveOptions, LineOptions

app = typer.Typer()


class RosOptions(WatchOptions, DriveOptions, LineOptions):
    """A robot that is shown to ROS 2, and may be driven by it."""

    domain: Annotated[int, Cli(envvar="ROS_DOMAIN_ID")] = Field(
        default=0, description="ROS domain."
    )
    frame_prefix: str = Field(
        default="",
        pattern=r"^[A-Za-z0-9_/]*$",
        description="Before the names of the robot's frames, such as khepera1/, for several.",
    )
    drive: Annotated[bool, Cli(flags=("--drive",))] = Field(
        default=False,
        description="Let cmd_vel drive the robot at --port, while no controller of its name does;"
        " it stands half a second after the last one.",
    )


@app.command(epilog="[cyan]macor-hil ros2 --domain 7 --connect tcp/127.0.0.1:7448[/cyan]")
@takes(RosOptions)
def ros2(options: RosOptions) -> None:
    """Publish what is told of a robot as ROS 2 topics, for nodes with the Zenoh middleware.

    Pictures, odometry, tf, infrared, battery, diagnostics, plan and decisions; connect it to
    emulator and controller, and to the nodes' router. Nothing that ROS sends moves the robot, but
    with --drive: then this program asks its sensors, and cmd_vel moves it.
    """
    with extra("ros"):
        from macor_hil.runs.by_hand.ros_drive import drive
        from macor_hil.telemetry.ros2.bridge import bridge
        from macor_hil.telemetry.ros2.messages import Frames
    frames = Frames(options.frame_prefix)
    with session_of(options) as session:
        if not options.drive:
            bridge(session, options.robot, options.domain, frames)
            return
        if options.address.embedded:
            raise MacorError("--drive needs a robot in real time: name its --port")
        settings = options.drive_settings(options.measured().wheels)
        drive(session, options.robot, options.domain, frames, options, settings)
