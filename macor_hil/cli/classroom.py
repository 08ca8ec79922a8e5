"""Commands for a class: scores of all robots."""

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from math import inf
from typing import Annotated, Any, Final

import typer
import zenoh
from khepera_protocol.options import Cli, takes
from khepera_protocol.zenoh.config import DEFAULT_ENDPOINT
from khepera_protocol.zenoh.keys import TRUTH
from khepera_protocol.zenoh.payload_model import PayloadError
from khepera_protocol.zenoh.payloads import Truth
from khepera_protocol.zenoh.sample_checks import check_sample
from pydantic import Field, field_validator
from rich.console import Console
from rich.live import Live
from rich.table import Table

from macor_hil.cli.watching import DurationOptions
from macor_hil.hardware.options import ZenohConfigOptions
from macor_hil.monitor.scoreboard import Finish, Scoreboard, drawn
from macor_hil.telemetry.session import open_session

app = typer.Typer()

_PERIOD: Final = 0.25
_WAITING: Final = 10_000
"""Samples that wait at most; the oldest are left out."""


class ScoreOptions(ZenohConfigOptions, DurationOptions):
    """A scoreboard."""

    connect: Annotated[tuple[str, ...], Cli(metavar="ENDPOINT")] = Field(
        default=(DEFAULT_ENDPOINT,),
        description="The --listen of an emulator, there now or later; repeatable.",
    )
    goal: Annotated[str, Cli(metavar="X,Y,RADIUS")] = Field(
        default="", description="A circle to come to, metres: it ends an attempt."
    )
    json_lines: Annotated[bool, Cli(flags=("--json",))] = Field(
        default=False, description="At the end an object of JSON for each robot, and no table."
    )

    @field_validator("goal")
    @classmethod
    def _is_a_circle(cls, goal: str) -> str:
        if goal:
            _finish_of(goal)
        return goal

    @property
    def finish(self) -> Finish | None:
        """The circle to come to."""
        return _finish_of(self.goal) if self.goal else None


@app.command(epilog="[cyan]macor-hil score --goal 0.88,0.72,0.08[/cyan]")
@takes(ScoreOptions)
def score(options: ScoreOptions) -> None:
    """Show the scores of all emulated robots by their ground truth, whoever drives them.

    Collisions, way and time of each robot's present attempt, from its first motion on; a robot that
    is put elsewhere begins another one. With --goal its time ends there, and its fastest counts.
    """
    board = Scoreboard(options.finish)
    end = time.monotonic() + (inf if options.duration is None else options.duration)
    with (
        open_session([], options.connect, options.zenoh_config) as session,
        scored(session, board) as look,
    ):
        with suppress(KeyboardInterrupt):  # the way to end it
            _show(board, look, end, options)
        look()
    if options.json_lines:
        for line in json_lines(board):
            typer.echo(line)
    elif not Console().is_terminal:  # where it has not been seen yet
        Console().print(_table(board, options))


def json_lines(board: Scoreboard) -> Iterator[str]:
    """Yield an object of JSON for each robot, the best first."""
    for place, (name, each) in enumerate(board.ranking(), 1):
        best = None if each.best == inf else round(each.best, 3)
        facts = {"place": place, "robot": name, "attempts": each.attempts}
        counts = {"collisions": each.collisions, "way": round(each.way, 4)}
        times = {"time": round(each.time, 3), "finished": each.finished, "best": best}
        yield json.dumps({**facts, **counts, **times})


@contextmanager
def scored(session: zenoh.Session, board: Scoreboard) -> Iterator["Look"]:
    """Score all robots of a session, as often as what it gives is called."""
    heard: zenoh.handlers.RingChannel[zenoh.Sample] = zenoh.handlers.RingChannel(_WAITING)
    with session.declare_subscriber(TRUTH.of("*"), heard) as subscriber:
        yield Look(subscriber, board)


class Look:
    """Takes what has come into the scores; call it again and again."""

    def __init__(self, subscriber: zenoh.Subscriber[Any], board: Scoreboard) -> None:
        self._subscriber = subscriber
        self._board = board

    def __call__(self) -> None:
        """Take in what has come since the last time."""
        for _ in range(_WAITING):
            sample = self._subscriber.try_recv()
            if sample is None:
                return
            with suppress(PayloadError):  # somebody else's, whatever it is
                robot = _robot_of(str(sample.key_expr))
                check_sample(sample, TRUTH.of(robot), TRUTH.limit)
                self._board.add(robot, Truth.parse(sample.payload.to_bytes()))


def _show(board: Scoreboard, look: Look, end: float, options: ScoreOptions) -> None:
    """Keep the scores, and show them where somebody looks on."""
    console = Console()
    with ExitStack() as stack:
        live = None
        if console.is_terminal and not options.json_lines:
            live = stack.enter_context(Live(console=console, auto_refresh=False))
        while (now := time.monotonic()) < end:
            time.sleep(min(_PERIOD, end - now))
            look()
            if live:
                live.update(_table(board, options), refresh=True)


def _table(board: Scoreboard, options: ScoreOptions) -> Table:
    return drawn(board.ranking(), with_goal=options.finish is not None)


def _robot_of(key: str) -> str:
    """Return the robot's name in a key of the form `khepera/NAME/truth`.

    Raises:
        PayloadError: it has another form, or is for many robots.
    """
    parts = key.split("/")
    if len(parts) != len(TRUTH.of("x").split("/")) or "*" in key:
        raise PayloadError("it came for many keys")
    return parts[1]


def _finish_of(text: str) -> Finish:
    """Return a circle from its text.

    Raises:
        ValueError: it is none.
    """
    try:
        x, y, radius = map(float, text.split(","))
    except ValueError:
        raise ValueError(f"{text!r} is not X,Y,RADIUS, such as 0.88,0.72,0.08") from None
    if not (abs(x) < inf and abs(y) < inf and 0.0 < radius < inf):
        raise ValueError(f"{text!r} is not a circle: its radius must be more than 0")
    return Finish(x, y, radius)
