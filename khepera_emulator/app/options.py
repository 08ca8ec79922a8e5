"""Options of the commands beside those that make a robot: its line, its Zenoh keys, its bench."""

import re
from pathlib import Path
from typing import Annotated, Final

from khepera_protocol.options import Cli
from khepera_protocol.text import quoted
from khepera_protocol.zenoh.config import DEFAULT_ENDPOINT
from pydantic import BaseModel, ConfigDict, Field, field_validator

from khepera_emulator.ports.opening import PORTS, TERMINAL

_ROBOT: Final = re.compile(r"[A-Za-z0-9_.-]{1,64}")


class LineOptions(BaseModel):
    """The daemon's time, and the ends of its robots' serial lines."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    speed: float = Field(default=1.0, ge=0.01, le=1000.0, description="Speed-up of simulated time.")
    link: Path | None = Field(default=None, description="Symbolic link to make to the terminal.")
    port: Annotated[str | None, Cli(metavar="KIND[=ADDRESS]", names=PORTS.names)] = Field(
        default=None,
        description="Kind of port that a client opens: {names}; or file.py:Class. A terminal if"
        " absent.",
    )
    tcp: Annotated[str | None, Cli(metavar="HOST:PORT")] = Field(
        default=None,
        description="The same as --port tcp=HOST:PORT; port 0: a free one. With --robots the ports"
        " from there on, one each.",
    )
    rfc2217: Annotated[str | None, Cli(metavar="HOST:PORT")] = Field(
        default=None,
        description="The same as --port rfc2217=HOST:PORT, a serial port server; ports as with"
        " --tcp.",
    )
    expose: Annotated[bool, Cli(flags=("--expose",))] = Field(
        default=False, description="Let other machines reach --tcp and --rfc2217."
    )
    fault_script: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None, description="A schedule of faults, TIME SPEC a line."
    )
    record: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None,
        description="Write down what passes on the line (see `replay`); with --robots in FILE-1,"
        " FILE-2 ...",
    )
    control: Annotated[bool, Cli(flags=("--control",))] = Field(
        default=False,
        description="Take resets and questions for the truth from the standard input, a line of"
        " JSON each, and end when it ends (see docs/testing.md).",
    )

    @property
    def on_terminal(self) -> bool:
        """True if the robots' lines are pseudo-terminals."""
        return self.port in (None, TERMINAL) and self.tcp is None and self.rfc2217 is None


class ZenohOptions(BaseModel):
    """A robot's side channel: camera, ground truth and reset."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    robot: Annotated[str, Cli(metavar="NAME")] = Field(
        default="khepera", description="Name in the Zenoh keys."
    )
    listen: Annotated[str, Cli(metavar="ENDPOINT")] = Field(
        default=DEFAULT_ENDPOINT, description="Endpoint that Zenoh peers find this robot on."
    )
    connect: Annotated[tuple[str, ...], Cli(metavar="ENDPOINT")] = Field(
        default=(),
        description="A Zenoh peer to connect to, now or when it appears; repeatable.",
    )
    zenoh_config: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None,
        description="Zenoh's own configuration (JSON5), for routers, TLS and access control;"
        " overrides --listen and --connect.",
    )
    camera_rate: float = Field(
        default=10.0, ge=0.1, le=100.0, description="Frames a second, while someone listens."
    )
    zenoh: bool = Field(default=True, description="Offer camera, ground truth and reset.")

    @field_validator("robot")
    @classmethod
    def _is_a_name(cls, name: str) -> str:
        return _robot_name(name)


class BenchOptions(BaseModel):
    """Robots that run already, and how they are reached."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    robot: Annotated[str | None, Cli(metavar="NAME")] = Field(
        default=None, description="Name of a robot; without it all that are found."
    )
    connect: Annotated[tuple[str, ...], Cli(metavar="ENDPOINT")] = Field(
        default=(DEFAULT_ENDPOINT,),
        description="The --listen of the emulator that is asked; repeatable.",
    )
    zenoh_config: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None,
        description="Zenoh's own configuration (JSON5), for routers, TLS and access control;"
        " overrides --connect.",
    )

    @field_validator("robot")
    @classmethod
    def _is_a_name(cls, name: str | None) -> str | None:
        return None if name is None else _robot_name(name)


def _robot_name(name: str) -> str:
    """Return a name that can stand in a Zenoh key.

    Raises:
        ValueError: it cannot.
    """
    if not _ROBOT.fullmatch(name):
        raise ValueError(
            f"{quoted(name)}: a name is made of letters, digits, dots, dashes and"
            " underscores, 64 at most"
        )
    return name
