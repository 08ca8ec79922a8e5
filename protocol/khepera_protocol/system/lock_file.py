"""A file that a program holds (`flock`) while it lives or works on something: one at a time.

The lock goes with the process, however that ends. Its file has a content that nobody else's file
has: what is no lock is neither held nor taken away.
"""

import os
import stat
from contextlib import suppress
from pathlib import Path

from khepera_protocol.system.locking import lock_now
from khepera_protocol.system.opening import AT_ONCE, BYTES, NO_LINK, UNSHARED


class NotALockError(OSError):
    """Something else stands where the lock belongs."""


def take_lock(path: Path, text: bytes) -> int:
    """Make a lock's file if need be, and hold it.

    Args:
        path: where; its folder is there.
        text: content of all locks of this kind.

    Returns:
        The descriptor that holds it until `give_back_lock`.

    Raises:
        BlockingIOError: somebody holds it.
        NotALockError: a file with another content, or no file, stands there.
        OSError: it cannot be opened.
    """
    flags = os.O_RDWR | os.O_CREAT | NO_LINK | AT_ONCE | UNSHARED | BYTES
    while True:
        lock = os.open(path, flags, 0o644)
        try:
            lock_now(lock)
            # the holder before may have taken the file away between our opening and locking it
            if _leads_to(path, lock):
                _mark(lock, text)
                return lock
        except BaseException:
            os.close(lock)
            raise
        os.close(lock)


def give_back_lock(path: Path, lock: int) -> None:
    """Take a lock's file away, unless another stands there by now, and hold it no longer."""
    with suppress(OSError):
        if _leads_to(path, lock):
            path.unlink()
    os.close(lock)


def _mark(lock: int, text: bytes) -> None:
    """Write into a new lock what it is.

    Raises:
        NotALockError: it is none.
    """
    is_file = stat.S_ISREG(os.fstat(lock).st_mode)
    found = os.read(lock, len(text) + 1) if is_file else None
    if found == b"":
        os.write(lock, text)
    elif found != text:
        raise NotALockError


def _leads_to(path: Path, descriptor: int) -> bool:
    """Tell whether a path is still the file that was opened."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    except FileNotFoundError:
        return False
