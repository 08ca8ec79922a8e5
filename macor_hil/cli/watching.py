"""Commands that watch a controller and never touch it."""

import json
import socket
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from khepera_protocol.options import Cli, takes
from khepera_protocol.text import printable
from khepera_protocol.zenoh.config import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT
from khepera_protocol.zenoh.keys import KEYS
from khepera_protocol.zenoh.schema import schema_of
from pydantic import Field

from macor_hil.cli.common import extra, session_of
from macor_hil.cli.ending import Status, kept
from macor_hil.cli.paths import check_file
from macor_hil.errors import MacorError, TelemetryError
from macor_hil.hardware.options import Options, ZenohConfigOptions, ZenohOptions
from macor_hil.monitor.terminal import watch
from macor_hil.safety.claim import claim
from macor_hil.telemetry.keys_page import keys_page
from macor_hil.telemetry.session import open_session

app = typer.Typer()


class WatchOptions(ZenohOptions):
    """A robot and controller that are watched."""

    connect: Annotated[tuple[str, ...], Cli(metavar="ENDPOINT")] = Field(
        default=(CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT),
        description="Zenoh peers, there now or later.",
    )


class DurationOptions(Options):
    """Duration of watching."""

    duration: Annotated[float | None, Cli(flags=("--for",), metavar="SECONDS")] = Field(
        default=None, ge=0.1, description="End after a time."
    )


class MonitorOptions(WatchOptions, DurationOptions):
    """A watcher in the terminal."""

    once: Annotated[bool, Cli(flags=("--once",))] = Field(
        default=False, description="Show a single picture; exit status 1 without a controller."
    )


class RecordOptions(WatchOptions, DurationOptions):
    """A recording that is written."""

    file: Annotated[Path, Cli(argument=True)] = Field(
        description="MCAP file to write; replaced if it is there."
    )


class ReplayOptions(ZenohConfigOptions):
    """A recording that is published again."""

    file: Annotated[Path, Cli(argument=True)] = Field(description="A recording of `record`.")
    speed: float = Field(
        default=1.0, ge=0.01, le=1000.0, description="Speed-up of the recorded time."
    )
    begin: Annotated[float, Cli(metavar="SECONDS")] = Field(
        default=0.0, ge=0.0, description="Seconds after its beginning at which to begin."
    )
    robot: Annotated[str | None, Cli(metavar="NAME")] = Field(
        default=None, description="Another name than the recorded robot's."
    )
    listen: Annotated[tuple[str, ...], Cli(metavar="ENDPOINT")] = Field(
        default=(CONTROLLER_ENDPOINT,), description="Where watchers find it."
    )


class DashboardOptions(WatchOptions):
    """A watcher in the browser."""

    file: Annotated[Path | None, Cli(argument=True)] = Field(
        default=None, description="A recording to scrub through; without it: live."
    )
    port: int = Field(default=8080, ge=1, le=65535, description="TCP port of the page.")


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
    typer.echo(json.dumps(schema_of(payload), indent=2))


@app.command(epilog="[cyan]macor-hil monitor --connect tcp/127.0.0.1:7448[/cyan]")
@takes(MonitorOptions)
def monitor(options: MonitorOptions) -> None:
    """Watch a controller in the terminal; a Zenoh subscriber and nothing else."""
    with session_of(options) as session:
        there = watch(session, options.robot, options.once, options.duration)
    if options.once and not there:
        raise typer.Exit(Status.NO)


@app.command(epilog="[cyan]macor-hil record runs/drive.mcap --for 60[/cyan]")
@takes(RecordOptions)
def record(options: RecordOptions) -> None:
    """Record what is told of a robot: pictures, decisions, poses, infrared, the line's bytes.

    Foxglove and other readers of MCAP open the file as it is; so does one of a recorder that was
    killed. Ctrl-C, SIGTERM or a closed terminal ends the recording, and its file is whole.
    """
    file = options.file
    check_file("the recording", file)
    with extra("recording"):
        from macor_hil.telemetry.recordings.recorder import record as write
    with claim(file), session_of(options) as session:
        samples, not_taken = write(session, options.robot, file, options.duration)
    typer.echo("; ".join(filter(None, [f"{file}: {samples} samples", not_taken.words()])))


@app.command(epilog="[cyan]macor-hil replay runs/drive.mcap --speed 2[/cyan]")
@takes(ReplayOptions)
def replay(options: ReplayOptions) -> None:
    """Publish a recording again, with its times: every monitor works on it."""
    with extra("recording"):
        from macor_hil.telemetry.recordings.recording import play_recording
    from macor_hil.telemetry.recordings.player import Player, play

    name, events = play_recording(options.file, options.begin)
    with (
        open_session(options.listen, [], options.zenoh_config) as session,
        Player(session, options.robot or name) as player,
        kept(lambda: f"{player.published} events were published; the same command begins anew"),
    ):
        count = play(events, player, options.speed)
    typer.echo(f"{options.file}: {count} events of {printable(name)}")


@app.command(
    epilog="[cyan]macor-hil dashboard[/cyan]\n\n[cyan]macor-hil dashboard runs/drive.mcap[/cyan]"
)
@takes(DashboardOptions)
def dashboard(options: DashboardOptions) -> None:
    """Watch a robot in the browser: camera, arena, plans, activities, reinforcement, the line.

    The page is served to this machine only. Keys: space pauses; in a recording the arrows, Home
    and End move.
    """
    with extra("dashboard"):
        from macor_hil.monitor.dashboard.app import serve
    from macor_hil.monitor.dashboard.sources import LiveSource, RecordingSource
    from macor_hil.monitor.follower import Follower

    with ExitStack() as stack:
        open_source: Callable[[], LiveSource | RecordingSource]
        poll = None
        if options.file is None:
            session = stack.enter_context(session_of(options))
            live = LiveSource(stack.enter_context(Follower(session, options.robot, camera=True)))
            open_source, poll = lambda: live, live.poll
        else:
            with extra("recording"):
                from macor_hil.telemetry.recordings.recording import read_recording
            name, events = read_recording(options.file)
            open_source = partial(RecordingSource, printable(name, 100), events)
        port = options.port
        _check_free(port)
        serve(open_source, port, lambda: typer.echo(f"http://127.0.0.1:{port}"), poll)


def _check_free(port: int) -> None:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            raise MacorError(
                f"cannot serve on port {port}: {error.strerror}; give another --port"
            ) from None
