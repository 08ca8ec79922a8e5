"""Commands that watch a controller and never touch it."""

import typer

from macor_hil.cli.options import ConnectOption, RobotOption
from macor_hil.monitor.terminal import watch
from protocol.side_channel import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT

app = typer.Typer()


@app.command(epilog="[cyan]macor-hil monitor --connect tcp/127.0.0.1:7448[/cyan]")
def monitor(
    robot: RobotOption = "khepera",
    connect: ConnectOption = [CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT],  # noqa: B006
) -> None:
    """Watch a controller in the terminal; a Zenoh subscriber and nothing else."""
    watch(robot, [], connect)
