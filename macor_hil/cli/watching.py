"""Commands that watch a controller and never touch it."""

import json
import socket
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from khepera_protocol.text import printable
from khepera_protocol.zenoh.keys import KEYS
from khepera_protocol.zenoh.payloads import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT
from khepera_protocol.zenoh.schema import schema_of

from macor_hil.cli.ending import Status, kept
from macor_hil.cli.options import ConnectOption, RobotOption, ZenohConfigOption, extra
from macor_hil.cli.paths import check_file
from macor_hil.errors import MacorError, TelemetryError
from macor_hil.monitor.terminal import watch
from macor_hil.safety.claim import claim
from macor_hil.telemetry.keys_page import keys_page
from macor_hil.telemetry.session import open_session

app = typer.Typer()

DurationOption = Annotated[
    float | None, typer.Option("--for", metavar="SECONDS", min=0.1, help="End after a time.")
]


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
def monitor(
    robot: RobotOption = "khepera",
    once: Annotated[
        bool,
        typer.Option("--once", help="Show a single picture; exit status 1 without a controller."),
    ] = False,
    duration: DurationOption = None,
    connect: ConnectOption = [CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT],  # noqa: B006
    zenoh_config: ZenohConfigOption = None,
) -> None:
    """Watch a controller in the terminal; a Zenoh subscriber and nothing else."""
    with open_session([], connect, zenoh_config) as session:
        there = watch(session, robot, once, duration)
    if once and not there:
        raise typer.Exit(Status.NO)


@app.command(epilog="[cyan]macor-hil record runs/drive.mcap --for 60[/cyan]")
def record(
    file: Annotated[Path, typer.Argument(help="MCAP file to write; replaced if it is there.")],
    robot: RobotOption = "khepera",
    duration: DurationOption = None,
    connect: ConnectOption = [CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT],  # noqa: B006
    zenoh_config: ZenohConfigOption = None,
) -> None:
    """Record what is told of a robot: pictures, decisions, poses, infrared, the line's bytes.

    Foxglove and other readers of MCAP open the file as it is; so does one of a recorder that was
    killed. Ctrl-C, SIGTERM or a closed terminal ends the recording, and its file is whole.
    """
    check_file("the recording", file)
    with extra("recording"):
        from macor_hil.telemetry.recordings.recorder import record as write
    with claim(file), open_session([], connect, zenoh_config) as session:
        samples, not_taken = write(session, robot, file, duration)
    typer.echo("; ".join(filter(None, [f"{file}: {samples} samples", not_taken.words()])))


@app.command(epilog="[cyan]macor-hil replay runs/drive.mcap --speed 2[/cyan]")
def replay(
    file: Annotated[Path, typer.Argument(help="A recording of `record`.")],
    speed: Annotated[
        float, typer.Option(min=0.01, max=1000.0, help="Time runs so many times faster.")
    ] = 1.0,
    robot: Annotated[
        str | None, typer.Option(metavar="NAME", help="Another name than the recorded robot's.")
    ] = None,
    listen: Annotated[
        list[str], typer.Option(metavar="ENDPOINT", help="Where watchers find it.")
    ] = [CONTROLLER_ENDPOINT],  # noqa: B006
    zenoh_config: ZenohConfigOption = None,
) -> None:
    """Publish a recording again, with its times: every monitor works on it."""
    with extra("recording"):
        from macor_hil.telemetry.recordings.recording import play_recording
    from macor_hil.telemetry.recordings.player import Player, play

    name, events = play_recording(file)
    with (
        open_session(listen, [], zenoh_config) as session,
        Player(session, robot or name) as player,
        kept(lambda: f"{player.published} events were published; the same command begins anew"),
    ):
        count = play(events, player, speed)
    typer.echo(f"{file}: {count} events of {printable(name)}")


@app.command(
    epilog="[cyan]macor-hil dashboard[/cyan]\n\n[cyan]macor-hil dashboard runs/drive.mcap[/cyan]"
)
def dashboard(
    file: Annotated[
        Path | None, typer.Argument(help="A recording to scrub through; without it: live.")
    ] = None,
    port: Annotated[int, typer.Option(min=1, max=65535, help="TCP port of the page.")] = 8080,
    robot: RobotOption = "khepera",
    connect: ConnectOption = [CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT],  # noqa: B006
    zenoh_config: ZenohConfigOption = None,
) -> None:
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
        if file is None:
            session = stack.enter_context(open_session([], connect, zenoh_config))
            live = LiveSource(stack.enter_context(Follower(session, robot, camera=True)))
            open_source, poll = lambda: live, live.poll
        else:
            with extra("recording"):
                from macor_hil.telemetry.recordings.recording import read_recording
            name, events = read_recording(file)
            open_source = partial(RecordingSource, printable(name, 100), events)
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
