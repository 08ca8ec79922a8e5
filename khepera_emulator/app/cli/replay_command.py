"""`khepera-emulator replay`: play a wire log to a robot."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from khepera_protocol.options import Cli
from pydantic import BaseModel, Field

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.wire_log import Recording, read_log
from khepera_emulator.robot.options import ROBOT

_DIFFERENT: Final = 1


class ReplayOptions(BaseModel):
    """A wire log, and the robot that it is played to."""

    file: Annotated[Path, Cli(argument=True)] = Field(
        description="A wire log, as `run --record` writes it."
    )
    port: Annotated[str | None, Cli(metavar="URL")] = Field(
        default=None,
        description="Any pySerial port with a robot just switched on, such as /dev/ttyUSB0;"
        " without it an emulated robot like the recorded one, in virtual time.",
    )
    ignore: Annotated[str, Cli(metavar="LETTERS")] = Field(
        default="",
        description="Requests whose replies may have other values, such as N,O,E,H.",
    )
    allow: Annotated[tuple[str, ...], Cli(metavar="FILE.py:CLASS")] = Field(
        default=(),
        description="Code of its own, such as a turret, that the log's robot may use; repeatable.",
    )


def replay(options: ReplayOptions) -> None:
    """Play the requests of a wire log at their times, and compare the replies.

    Exit status: 0 if all are equal, 1 at the first difference, which is printed, 2 if the log is
    damaged: what stands before the damage is replayed all the same.
    """
    from khepera_emulator.app.replay import Difference
    from khepera_emulator.app.replay import replay as play

    recording = read_log(options.file)
    url = options.port or _recorded_robot(options.file, recording)
    letters = [word.strip() for word in options.ignore.split(",")]
    try:
        with _line(url, options.allow) as line, _stopping(line):
            result = play(recording, line, letters)
    except (OSError, ValueError) as error:
        raise EmulatorError(f"cannot replay on {url}: {error}") from None
    if isinstance(result, Difference):
        typer.echo(str(result))
        raise typer.Exit(_DIFFERENT)
    typer.echo(f"{result} reply lines equal")
    if recording.damage:
        raise EmulatorError(f"{recording.damage}; only what stands before was replayed")


def _recorded_robot(file: Path, recording: Recording) -> str:
    """Return the robot that a log names, which may be an emulated one, and no device or file."""
    if not recording.url.startswith(ROBOT):
        raise EmulatorError(
            f"{file} names {recording.url[:100]!r} as its robot, which is no emulated one"
            f" ({ROBOT}...); give --port to replay it on a port of your own"
        )
    return recording.url


def _line(url: str, allowed: Sequence[str]) -> Any:
    """Make a port that is not open yet; the robot of a log runs no code but what is allowed."""
    import serial

    import khepera_emulator  # noqa: F401 - registers khepera://

    line = serial.serial_for_url(url, timeout=1.0, do_not_open=True)
    if hasattr(line, "allowed"):
        line.allowed = allowed
    return line


@contextmanager
def _stopping(line: Any) -> Iterator[None]:
    """Leave a standing robot, whatever ends the replay; one in this process ends with it."""
    try:
        yield
    finally:
        if not hasattr(line, "emulator"):
            with suppress(OSError):  # the port has failed
                line.write(b"\nD,0,0\n")
                line.flush()
