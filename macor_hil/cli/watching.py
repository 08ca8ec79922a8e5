"""Commands that watch a controller and never touch it."""

import json
from functools import partial
from ipaddress import ip_address
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Self

import typer
from khepera_protocol.options import Cli, takes
from khepera_protocol.text import printable
from khepera_protocol.zenoh.config import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT
from khepera_protocol.zenoh.keys import KEYS
from khepera_protocol.zenoh.schema import schema_of
from pydantic import Field, model_validator

from macor_hil.cli.common import extra, session_of
from macor_hil.cli.ending import Status, kept
from macor_hil.cli.paths import check_file
from macor_hil.errors import MacorError, TelemetryError
from macor_hil.hardware.options import Options, ZenohConfigOptions, ZenohOptions
from macor_hil.monitor.dashboard.passwords import hash_password, is_hash
from macor_hil.monitor.terminal import watch
from macor_hil.safety.claim import claim
from macor_hil.telemetry.keys_page import keys_page
from macor_hil.telemetry.session import open_session

if TYPE_CHECKING:
    from macor_hil.monitor.dashboard.app import Doors

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


class DashboardOptions(ZenohConfigOptions):
    """A watcher in the browser."""

    file: Annotated[Path | None, Cli(argument=True)] = Field(
        default=None, description="A recording to scrub through; without it: live."
    )
    robot: Annotated[tuple[str, ...], Cli(metavar="NAME")] = Field(
        default=(), description="Names of robots to show; without them all that are found."
    )
    connect: Annotated[tuple[str, ...], Cli(metavar="ENDPOINT")] = Field(
        default=(CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT),
        description="Zenoh peers, there now or later.",
    )
    port: int = Field(
        default=8080, ge=0, le=65535, description="TCP port of the page; 0: a free one."
    )
    host: str = Field(
        default="127.0.0.1",
        description="Address to serve on. Other than this machine alone: only with a password, and"
        " with TLS files or behind a proxy.",
    )
    name: Annotated[tuple[str, ...], Cli(metavar="HOST")] = Field(
        default=(),
        description="Hosts by which browsers elsewhere call the page, as in its address.",
    )
    password_hash: Annotated[str, Cli(metavar="HASH")] = Field(
        default="", description="Of the page's password; see `macor-hil hash-password`."
    )
    certificate: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None, description="TLS certificate and its chain, PEM."
    )
    key: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None, description="Key of the certificate, PEM."
    )
    behind_proxy: Annotated[bool, Cli(flags=("--behind-proxy",))] = Field(
        default=False, description="A proxy in front of it speaks TLS with browsers."
    )
    allow_control: Annotated[bool, Cli(flags=("--allow-control",))] = Field(
        default=False, description="Let the page steer robots and controllers."
    )

    @model_validator(mode="after")
    def _is_safe(self) -> Self:
        if self.password_hash and not is_hash(self.password_hash):
            raise ValueError("--password-hash is none that `macor-hil hash-password` printed")
        if (self.certificate is None) != (self.key is None):
            raise ValueError("--certificate and --key go together")
        outside = not _is_loopback(self.host)
        if (outside or self.name) and not self.password_hash:
            door = f"--host {printable(self.host, 60)}" if outside else "--name"
            raise ValueError(
                f"{door} opens the page to other machines, which takes a --password-hash; make one"
                " with `macor-hil hash-password`"
            )
        if outside and not (self.certificate or self.behind_proxy):
            raise ValueError(
                f"--host {printable(self.host, 60)} takes --certificate and --key, or a proxy with"
                " TLS in front of it (--behind-proxy)"
            )
        if outside and not self.name:
            raise ValueError("--host takes --name, the host in the address that browsers call")
        return self

    @property
    def doors(self) -> "Doors":
        """Address of the page, and those whom it is served to."""
        from macor_hil.monitor.dashboard.access import LOOPBACK
        from macor_hil.monitor.dashboard.app import Doors

        return Doors(
            host=self.host,
            port=self.port,
            names=LOOPBACK | {name.lower() for name in self.name},
            password_hash=self.password_hash,
            certificate=str(self.certificate or ""),
            key=str(self.key or ""),
            proxied=self.behind_proxy,
        )


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


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
    """Watch robots in the browser: camera, arena, plans, activities, reinforcement, the line.

    The page is served to this machine only, unless --host says otherwise, and only watches, unless
    --allow-control lets it steer. Keys: space pauses; in a recording the arrows, Home and End move,
    n and p go to the next and the last collision or failure.
    """
    with extra("dashboard"):
        from macor_hil.monitor.dashboard.app import run
    from macor_hil.monitor.dashboard.playing import RecordingSource, Timeline
    from macor_hil.monitor.dashboard.sources import Live, LiveView, RecordingView
    from macor_hil.monitor.dashboard.steering import steer
    from macor_hil.monitor.roster import Roster

    if options.file is not None:
        if options.allow_control:
            raise MacorError("a recording cannot be steered; leave --allow-control out")
        with extra("recording"):
            from macor_hil.telemetry.recordings.recording import has_index, play_recording
        reading = partial(play_recording, options.file)
        timeline = Timeline(reading, has_index=has_index(options.file))
        run(
            lambda look: RecordingView(RecordingSource(timeline).resumed(look)),
            options.doors,
            typer.echo,
        )
        return
    with (
        open_session((), options.connect, options.zenoh_config) as session,
        Roster(session, options.robot) as roster,
    ):
        live = Live(roster)
        run(
            lambda look: LiveView(live, look.robot),
            options.doors,
            typer.echo,
            live.poll,
            partial(steer, session) if options.allow_control else None,
        )


@app.command(name="hash-password", epilog="[cyan]macor-hil hash-password[/cyan]")
def hash_password_of() -> None:
    """Ask for a password, and print its hash for `dashboard --password-hash`."""
    password = typer.prompt("Password", hide_input=True, confirmation_prompt=True, err=True)
    typer.echo(hash_password(password))
