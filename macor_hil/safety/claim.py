"""A file that one program at a time works on for long: a map in training, a recording.

Who works on it holds a lock (`flock`) on a file beside it, which goes with the process however that
ends. The lock's file has a name and a content that no file of anybody else's has, and is taken away
only by who holds it.
"""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from macor_hil.errors import MacorError

_TEXT: Final = b"macor-hil holds this file while it writes the one beside it\n"


@contextmanager
def claim(path: Path) -> Iterator[None]:
    """Hold a file against other programs that would write it; its folder is made if need be.

    Raises:
        MacorError: another one works on it, or its folder cannot be written.
    """
    lock_path = lock_of(path)
    try:
        lock_path.parent.mkdir(parents=True, exist_ok=True)
        lock = _take(lock_path)
    except BlockingIOError:
        raise MacorError(
            f"another program is writing {path}; wait for its end, or name another file"
        ) from None
    except OSError as error:
        raise MacorError(f"cannot write {path}: {error.strerror}") from None
    try:
        yield
    finally:
        with suppress(OSError):
            if _leads_to(lock_path, lock):
                lock_path.unlink()
        os.close(lock)


def lock_of(path: Path) -> Path:
    """Return the path of the file that is locked while a file is worked on."""
    path = path.resolve()
    return path.with_name(f".{path.name}.macor-hil-lock")


def _take(path: Path) -> int:
    """Open and lock a lock's file."""
    while True:
        lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # the holder before may have taken it away between our opening and locking it
            if _leads_to(path, lock):
                _mark(path, lock)
                return lock
        except BaseException:
            os.close(lock)
            raise
        os.close(lock)


def _mark(path: Path, lock: int) -> None:
    """Write into a new lock what it is; refuse a file that is none."""
    found = os.read(lock, len(_TEXT) + 1)
    if not found:
        os.write(lock, _TEXT)
    elif found != _TEXT:
        raise MacorError(f"{path} is where a lock belongs, and is none; move it away")


def _leads_to(path: Path, descriptor: int) -> bool:
    """Return True if a path is still the file that was opened."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    except FileNotFoundError:
        return False
