"""The command that shows a controller to ROS 2."""

from typing import Annotated

import typer
from khepera_protocol.options import Cli, takes
from pydantic import Field

from macor_hil.cli.common import extra
from macor_hil.cli.watching import WatchOptions

app = typer.Typer()


class RosOptions(WatchOptions):
    """A controller that is shown to ROS 2."""

    domain: Annotated[int, Cli(envvar="ROS_DOMAIN_ID")] = Field(
        default=0, description="ROS domain."
    )
    frame_prefix: str = Field(
        default="",
        pattern=r"^[A-Za-z0-9_/]*$",
        description="Before the names of the robot's frames, such as khepera1/, for several.",
    )


@app.command(epilog="[cyan]macor-hil ros2 --domain 7 --connect tcp/127.0.0.1:7448[/cyan]")
@takes(RosOptions)
def ros2(options: RosOptions) -> None:
    """Publish what a controller tells as ROS 2 topics, for nodes with the Zenoh middleware.

    Pictures, odometry and commands; connect it to the controller, and to the nodes' router.
    """
    with extra("ros"):
        from macor_hil.telemetry.ros2.bridge import bridge
    bridge(
        options.robot,
        options.connect,
        options.domain,
        options.zenoh_config,
        options.frame_prefix,
    )
