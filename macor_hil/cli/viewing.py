"""Commands for viewers of robots: Foxglove and Lichtblick."""

import json
from pathlib import Path
from typing import Annotated

import typer
from khepera_protocol.options import Cli, takes
from pydantic import Field

from macor_hil.cli.common import extra, session_of
from macor_hil.cli.paths import check_file
from macor_hil.cli.watching import WatchOptions
from macor_hil.files import write_atomically
from macor_hil.telemetry.viewers.layout import layout as layout_of

app = typer.Typer()


class FoxgloveOptions(WatchOptions):
    """A robot that is shown to viewers."""

    host: str = Field(
        default="127.0.0.1",
        description="Address to listen on; whoever reaches it sees the robot.",
    )
    port: int = Field(default=8765, ge=0, le=65535, description="TCP port; 0: any free one.")
    layout: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None, description="Write a layout of panels for the viewer to import, and end."
    )


@app.command(
    epilog="[cyan]macor-hil foxglove[/cyan]\n\n"
    "[cyan]macor-hil foxglove --layout runs/khepera.json[/cyan]"
)
@takes(FoxgloveOptions)
def foxglove(options: FoxgloveOptions) -> None:
    """Show a robot live in Foxglove or Lichtblick: the topics of a recording, as they happen.

    In the viewer open a connection "Foxglove WebSocket" to ws://127.0.0.1:8765. Viewers only
    look: nothing that they send has any effect.
    """
    if options.layout is not None:
        check_file("--layout", options.layout)
        text = json.dumps(layout_of(options.robot), indent=1) + "\n"
        write_atomically(options.layout, text.encode())
        typer.echo(f"{options.layout}: import it as a layout")
        return
    with extra("foxglove"):
        from macor_hil.telemetry.viewers.live import show
    with session_of(options) as session:
        not_taken = show(session, options.robot, options.host, options.port, typer.echo)
    if words := not_taken.words():
        typer.echo(f"not shown: {words}")
