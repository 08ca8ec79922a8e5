"""Loading PyBullet, without its greeting."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from platform import machine
from typing import Final

from khepera_protocol.extras import how_to_install

from khepera_emulator.errors import EmulatorError

_STDERR: Final = 2


WHEELS: Final = {("linux", "x86_64"), ("darwin", "arm64"), ("win32", "AMD64")}
"""Systems and processors that wheels of PyBullet, or of its fork, are there for."""

_FIRST_WITHOUT: Final = (3, 14)
"""The first CPython that has none."""


def load_physics(reason: str) -> None:
    """Import PyBullet; its C code greets on the standard error output, which is closed to it.

    Args:
        reason: a clause that says why it is needed.

    Raises:
        EmulatorError: it is not installed.
    """
    with _silent():
        try:
            import pybullet  # noqa: F401
        except ModuleNotFoundError:
            raise EmulatorError(f"{reason}, for which PyBullet is missing; {_advice()}") from None


def _advice() -> str:
    if sys.version_info < _FIRST_WITHOUT and (sys.platform, machine()) in WHEELS:
        return f"install the extra 'emulator' with: {how_to_install('emulator')}"
    return (
        f"there is none for CPython {sys.version_info[0]}.{sys.version_info[1]} on"
        f" {sys.platform} {machine()}: take CPython 3.11 to 3.13 on x86_64 Linux, or one robot in"
        " an arena of walls and posts"
    )


@contextmanager
def _silent() -> Iterator[None]:
    """Let nothing be said on the standard error output, if there is one."""
    try:
        kept = os.dup(_STDERR)
    except OSError:  # a parent has closed it
        yield
        return
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), _STDERR)
    try:
        yield
    finally:
        os.dup2(kept, _STDERR)
        os.close(kept)
