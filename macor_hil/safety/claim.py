"""A file that one program at a time works on for long: a map in training, a recording.

Who works on it holds a lock on a file beside it.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from khepera_protocol.system.lock_file import NotALockError, give_back_lock, take_lock

from macor_hil.errors import MacorError
from macor_hil.safety.interruption import unbroken

_TEXT: Final = b"macor-hil holds this file while it writes the one beside it\n"


@contextmanager
def claim(path: Path) -> Iterator[None]:
    """Hold a file against other programs that would write it; its folder is made if need be.

    Raises:
        MacorError: another one works on it, or its folder cannot be written.
    """
    lock_path = lock_of(path)
    lock: int | None = None
    try:
        # a signal in the middle of it would leave the lock's file behind
        with unbroken():
            lock = _taken(path, lock_path)
        yield
    finally:
        if lock is not None:
            give_back_lock(lock_path, lock)


def _taken(path: Path, lock_path: Path) -> int:
    try:
        lock_path.parent.mkdir(parents=True, exist_ok=True)
        return take_lock(lock_path, _TEXT)
    except BlockingIOError:
        raise MacorError(
            f"another program is writing {path}; wait for its end, or name another file"
        ) from None
    except NotALockError:
        raise MacorError(
            f"{lock_path} is where a lock belongs, and is none; move it away"
        ) from None
    except OSError as error:
        raise MacorError(f"cannot write {path}: {error.strerror}") from None


def lock_of(path: Path) -> Path:
    """Return the path of the file that is locked while a file is worked on."""
    path = path.resolve()
    return path.with_name(f".{path.name}.macor-hil-lock")
