"""Commands that watch a controller and never touch it."""

import json
from typing import Annotated

import typer

from macor_hil.cli.options import ConnectOption, RobotOption
from macor_hil.errors import TelemetryError
from macor_hil.monitor.terminal import watch
from macor_hil.telemetry.keys import KEYS
from macor_hil.telemetry.keys_page import keys_page
from protocol.side_channel import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT

app = typer.Typer()


@app.command(epilog="[cyan]macor-hil keys decision[/cyan]")
def keys(
    leaf: Annotated[
        str | None,
        typer.Argument(metavar="KEY", help="Last part of a key, such as decision: its schema."),
    ] = None,
) -> None:
    """Print the page of all Zenoh keys (docs/keys.md), or the JSON Schema of one."""
    if leaf is None:
        typer.echo(keys_page(), nl=False)
        return
    payload = next((key.payload for key in KEYS if key.leaf == leaf), None)
    if payload is None:
        known = ", ".join(key.leaf for key in KEYS if key.payload)
        raise TelemetryError(f"no key of JSON samples ends with {leaf!r}; there are {known}")
    typer.echo(json.dumps(payload.model_json_schema(), indent=2))


@app.command(epilog="[cyan]macor-hil monitor --connect tcp/127.0.0.1:7448[/cyan]")
def monitor(
    robot: RobotOption = "khepera",
    connect: ConnectOption = [CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT],  # noqa: B006
) -> None:
    """Watch a controller in the terminal; a Zenoh subscriber and nothing else."""
    watch(robot, [], connect)
