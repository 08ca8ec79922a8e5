"""`khepera-emulator place|reset|truth|watch`: robots that run already."""

import time
from collections.abc import Iterable
from typing import Annotated, Final

import typer
from khepera_protocol.options import Cli, takes
from khepera_protocol.text import printable
from khepera_protocol.zenoh.payloads import Pose, Reset, Truth
from pydantic import BaseModel, Field

from khepera_emulator.app.options import BenchOptions
from khepera_emulator.robot.options import HIGHEST_SEED

app = typer.Typer()

_NUMBERS: Final = {"ignore_unknown_options": True}
"""So that a negative number is a number, and no option."""


class PlaceOptions(BenchOptions):
    """A place for a robot."""

    robot: Annotated[str | None, Cli(metavar="NAME")] = Field(
        default=None, description="Name of the robot; without it the only one that is found."
    )
    x: Annotated[float, Cli(argument=True)] = Field(description="Metres.")
    y: Annotated[float, Cli(argument=True)] = Field(description="Metres.")
    heading: Annotated[float, Cli(argument=True)] = Field(
        default=0.0, description="Radians, counter-clockwise from the x axis."
    )


class ResetOptions(BenchOptions):
    """A start for robots."""

    seed: int | None = Field(
        default=None,
        ge=0,
        le=HIGHEST_SEED,
        description="Start all chance anew from this seed, and everything in the world with it.",
    )
    random: Annotated[bool, Cli(flags=("--random",))] = Field(
        default=False, description="A free place drawn by chance instead of the start."
    )


class FormatOptions(BaseModel):
    """The form of what is printed."""

    json_lines: Annotated[bool, Cli(flags=("--json",))] = Field(
        default=False, description="Print JSON, an object a line."
    )


class RateOptions(BaseModel):
    """The pace of watching."""

    rate: float = Field(default=1.0, ge=0.01, le=50.0, description="Looks a second.")


@app.command(
    epilog="[cyan]khepera-emulator place 0.3 -0.02 1.57[/cyan]\n\n"
    "[cyan]khepera-emulator place 0.3 0 --robot khepera-2[/cyan]",
    context_settings=_NUMBERS,
)
@takes(PlaceOptions, FormatOptions, config=False)
def place(options: PlaceOptions, form: FormatOptions) -> None:
    """Put a running robot in a place, at rest and powered on afresh.

    Prints where it is then. A place that is not free is refused, and nothing changes.
    """
    from khepera_emulator.app.bench import open_bench

    pose = Pose(x=options.x, y=options.y, heading=options.heading)
    with open_bench(options) as bench:
        _show([(bench.only, bench.reset(bench.only, Reset(pose=pose)))], form)


@app.command(
    epilog="[cyan]khepera-emulator reset --seed 7[/cyan]\n\n"
    "[cyan]khepera-emulator reset --random --robot khepera-2[/cyan]"
)
@takes(ResetOptions, FormatOptions, config=False)
def reset(options: ResetOptions, form: FormatOptions) -> None:
    """Put running robots where they started, at rest and powered on afresh.

    Prints where they are then. With --seed the things of their world go back, too.
    """
    from khepera_emulator.app.bench import open_bench

    with open_bench(options) as bench:
        several = len(bench.names) > 1
        # a seed puts all robots of a world at their starts: places by chance come after it
        if several and options.seed is not None:
            for name in bench.names:
                bench.reset(name, Reset(seed=options.seed))
        seed = None if several else options.seed
        for name in bench.names:
            bench.reset(name, Reset(seed=seed, random=options.random))
        _show(((name, bench.truth(name)) for name in bench.names), form)


@app.command(
    epilog="[cyan]khepera-emulator truth[/cyan]\n\n"
    "[cyan]khepera-emulator truth --robot khepera-2 --json[/cyan]"
)
@takes(BenchOptions, FormatOptions, config=False)
def truth(options: BenchOptions, form: FormatOptions) -> None:
    """Tell where running robots really are, a line for each."""
    from khepera_emulator.app.bench import open_bench

    with open_bench(options) as bench:
        _show(((name, bench.truth(name)) for name in bench.names), form)


@app.command(
    epilog="[cyan]khepera-emulator watch[/cyan]\n\n"
    "[cyan]khepera-emulator watch --rate 10 --json > runs/drive.jsonl[/cyan]"
)
@takes(BenchOptions, FormatOptions, RateOptions, config=False)
def watch(options: BenchOptions, form: FormatOptions, pace: RateOptions) -> None:
    """Tell where running robots really are, again and again until Ctrl-C."""
    from khepera_emulator.app.bench import open_bench

    with open_bench(options) as bench:
        due = time.monotonic()
        while True:
            _show(((name, bench.truth(name)) for name in bench.names), form)
            due = max(due + 1.0 / pace.rate, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))


def _show(truths: Iterable[tuple[str, Truth]], form: FormatOptions) -> None:
    for robot, each in truths:
        typer.echo(_json(robot, each) if form.json_lines else _line(robot, each))


def _json(robot: str, truth: Truth) -> str:
    """Return a truth with the robot's name in it, as an object of JSON."""
    return f'{{"robot":"{printable(robot)}",{truth.model_dump_json()[1:]}'


def _line(robot: str, truth: Truth) -> str:
    pose, (left, right) = truth.pose, truth.speed
    touch = "  touches" if truth.contact else "  has touched" if truth.touched else ""
    return (
        f"{printable(robot)}  {truth.time:9.3f} s  x {pose.x:7.4f} m  y {pose.y:7.4f} m"
        f"  heading {pose.heading:7.4f}  wheels {left:7.4f} {right:7.4f} m/s{touch}"
    )
