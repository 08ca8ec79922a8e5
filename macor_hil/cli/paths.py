"""Paths that a command will write to, refused before its work begins rather than after."""

import os
import stat
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryFile
from typing import Final

from khepera_protocol.text import printable

from macor_hil.errors import MacorError

_LONGEST_NAME: Final = 200
"""Bytes of a file's name: beside it stand others with longer ones (`.part`, locks)."""

_SHOWN: Final = 100
"""Characters of a path in a message."""

PICTURES: Final = (".png",)


def check_file(option: str, path: Path, suffixes: Sequence[str] = ()) -> None:
    """Refuse a path where no file can be written.

    Args:
        option: what the path was given with.
        path: the file, there or not.
        suffixes: ends of a name that can be written; none: any.

    Raises:
        MacorError: it is a folder or a device, has no such suffix, or its folder cannot be had.
    """
    _check_name(option, path)
    mode = _mode(path)
    if not path.name or path.name == ".." or (mode and stat.S_ISDIR(mode)):
        raise _refusal(option, path, "is a folder; name a file in it")
    if mode and not stat.S_ISREG(mode):
        raise _refusal(option, path, "is no ordinary file")
    if suffixes and path.suffix.lower() not in suffixes:
        raise _refusal(option, path, f"must end with {' or '.join(suffixes)}")
    _check_folder(option, path, path.parent)
    if mode and not os.access(path, os.W_OK):
        raise _refusal(option, path, "is write-protected")


def check_folder(option: str, path: Path) -> None:
    """Refuse a path where no folder can be written to.

    Args:
        option: what the path was given with.
        path: the folder, there or not.

    Raises:
        MacorError: it is the root folder or a file, or cannot be had.
    """
    _check_name(option, path)
    if path.resolve() == Path(path.anchor or "/"):
        raise _refusal(option, path, "is the root folder; name one below it")
    _check_folder(option, path, path)


def _check_name(option: str, path: Path) -> None:
    length = len(os.fsencode(path.name))
    if length > _LONGEST_NAME:
        raise MacorError(
            f"{option}: a name of {length} bytes is too long, {_LONGEST_NAME} are possible"
        )


def _check_folder(option: str, path: Path, folder: Path) -> None:
    """See that a folder is one that can be written to, or can be made."""
    while (mode := _mode(folder)) is None:
        folder = folder.parent
    if not stat.S_ISDIR(mode):
        raise _refusal(option, path, f"cannot be: {folder} is no folder")
    try:
        with TemporaryFile(dir=folder):
            pass  # only an attempt tells, for the superuser and for file systems of the kernel's
    except OSError as error:
        raise _refusal(option, path, f"cannot be written: {folder}: {error.strerror}") from None


def _mode(path: Path) -> int | None:
    """Return the mode of what a path leads to, links followed; None: nothing."""
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise _refusal("the path", path, f"cannot be used: {error.strerror}") from None


def _refusal(option: str, path: Path, why: str) -> MacorError:
    return MacorError(f"{option} {printable(str(path), _SHOWN)} {why}")
