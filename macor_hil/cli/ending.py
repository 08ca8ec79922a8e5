"""Exit statuses of the commands of `macor-hil`, and reports of work cut short."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import Final

import typer
from khepera_protocol.system.waiting import is_broken

from macor_hil.safety.interruption import interruption_in_charge

CLOSED_OUTPUT: Final = "a closed standard output"

_OUTPUT: Final = 1
_KEYS: Final = ("SIGINT", "SIGQUIT")


class Status(IntEnum):
    """Exit status of a command; docs/exit-status.md."""

    DONE = 0
    """It did what it was told, or was told to end by SIGTERM, SIGHUP or the stop key."""
    NO = 1
    """It did what it was told, and the answer is no."""
    FAILED = 2
    """An option, a file or a device is not what it should be, and will not be; refused in one
    sentence."""
    COLLISION = 3
    """A collision ended the drive."""
    LOST = 4
    """Robot, camera or telemetry are not there, or failed for good: they may come back."""
    INTERRUPTED = 130
    """Ctrl-C, or Ctrl-\\."""


SUMMARY: Final = (
    "0 done, or told to end by SIGTERM, SIGHUP or the stop key; 1 the answer is no; 2 refused or"
    " failed, one sentence says why; 3 `run` ended with a collision; 4 robot or camera are lost or"
    " not there; 130 Ctrl-C."
)
"""All exit statuses, for the help text."""


def status_after(name: str) -> Status:
    """Return the exit status of a command that was told to end.

    Args:
        name: of the signal or of who told it.
    """
    if name in _KEYS:
        return Status.INTERRUPTED
    return Status.FAILED if name == CLOSED_OUTPUT else Status.DONE


def closed_output() -> str:
    """Return a name for it if nobody can read the standard output any more, else nothing."""
    return CLOSED_OUTPUT if is_broken(_OUTPUT) else ""


def told(line: str) -> None:
    """Print a line of something that goes on; where nobody reads it, it goes on to its next look.

    So that a robot is stopped, and the end told, in one way only.
    """
    try:
        typer.echo(line)
    except BrokenPipeError:
        if interruption := interruption_in_charge():
            interruption.ask(CLOSED_OUTPUT)


@contextmanager
def kept(what: Callable[[], str]) -> Iterator[None]:
    """Have it told what was kept, and how to go on, if the command is told to end meanwhile.

    Of contexts within each other the inner one tells.
    """
    try:
        yield
    except BaseException as error:
        interruption = interruption_in_charge()
        # an interrupt may have become another error on its way, in a library that it hit
        if interruption and (interruption.name or isinstance(error, KeyboardInterrupt)):
            interruption.kept = interruption.kept or what()
        raise
