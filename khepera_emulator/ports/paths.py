"""Paths of files to write, looked at before there is anything to write."""

import os
from collections.abc import Collection
from pathlib import Path

from khepera_protocol.text import printable

from khepera_emulator.errors import EmulatorError


def check_name(option: str, path: Path) -> None:
    """See that a path ends with a name, as `/`, `.` and `..` do not.

    Raises:
        EmulatorError: it does not.
    """
    if path.name in ("", ".."):
        raise EmulatorError(f"{option} {path} names no file; give a path such as runs/khepera")


def check_output(path: Path, suffixes: Collection[str] = ()) -> None:
    """See that a file can be written.

    Args:
        path: of the file; one that is there will be replaced.
        suffixes: how its name may end; none: as it likes.

    Raises:
        EmulatorError: it cannot.
    """
    name = printable(str(path), 300)
    folder = path.parent
    try:
        if path.is_dir():
            raise EmulatorError(f"cannot write {name}: it is a folder")
        if suffixes and path.suffix.lower() not in suffixes:
            raise EmulatorError(f"cannot write {name}: give a name that ends with {_or(suffixes)}")
        if not folder.is_dir():
            raise EmulatorError(f"cannot write {name}: there is no folder {printable(str(folder))}")
        if not os.access(path if path.exists() else folder, os.W_OK):
            raise EmulatorError(f"cannot write {name}: it is not permitted")
    except OSError as error:
        raise EmulatorError(f"cannot write {name}: {error.strerror}") from None


def _or(words: Collection[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} or {last}" if first else last
