"""The command that shows a controller to ROS 2."""

from typing import Annotated

import typer
from khepera_protocol.zenoh.payloads import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT

from macor_hil.cli.options import ConnectOption, RobotOption, ZenohConfigOption, extra

app = typer.Typer()


@app.command(epilog="[cyan]macor-hil ros2 --domain 7 --connect tcp/127.0.0.1:7448[/cyan]")
def ros2(
    robot: RobotOption = "khepera",
    connect: ConnectOption = [CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT],  # noqa: B006
    domain: Annotated[int, typer.Option(envvar="ROS_DOMAIN_ID", help="ROS domain.")] = 0,
    zenoh_config: ZenohConfigOption = None,
) -> None:
    """Publish what a controller tells as ROS 2 topics, for nodes with the Zenoh middleware.

    Pictures, odometry and commands; connect it to the controller, and to the nodes' router.
    """
    with extra("ros"):
        from macor_hil.telemetry.ros2.bridge import bridge
    bridge(robot, connect, domain, zenoh_config)
