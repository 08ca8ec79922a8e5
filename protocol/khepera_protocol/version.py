"""The version of this distribution, and the option that shows it."""

from importlib.metadata import version
from typing import Annotated, Final

import typer

DISTRIBUTION: Final = "khepera-macor"


def installed_version() -> str:
    """Return the version of the installed distribution.

    Raises:
        importlib.metadata.PackageNotFoundError: it is not installed.
    """
    return version(DISTRIBUTION)


def _show(asked: bool) -> None:
    if asked:
        typer.echo(f"{DISTRIBUTION} {installed_version()}")
        raise typer.Exit


VersionOption = Annotated[
    bool,
    typer.Option("--version", callback=_show, is_eager=True, help="Show the version and exit."),
]
"""Option `--version` of a program."""
