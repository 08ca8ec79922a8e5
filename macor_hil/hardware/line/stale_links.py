"""Links to terminals of emulators that are gone."""

import os
from contextlib import suppress
from pathlib import Path
from typing import Final

from khepera_protocol.system.locking import lock_now
from khepera_protocol.system.opening import AT_ONCE, NO_LINK, UNSHARED
from khepera_protocol.system.terminal_link import LOCK_TEXT, lock_beside

_MOST_LINKS: Final = 40
"""Links that lead to each other, as many as Linux follows."""


def is_stale_link(path: Path) -> bool:
    """Return True if a path leads over a link of an emulator that ended without removing it.

    The number of a terminal goes to whoever asks for one next: behind such a link may be another
    robot, or somebody's shell.
    """
    with suppress(OSError, ValueError):  # no such path: opening it says so
        for _ in range(_MOST_LINKS):
            if not path.is_symlink():
                break
            if _holder_is_gone(lock_beside(path)):
                return True
            path = path.parent / path.readlink()
    return False


def _holder_is_gone(path: Path) -> bool:
    """Return True if there is an emulator's lock that nobody holds."""
    try:
        lock = os.open(path, os.O_RDONLY | NO_LINK | AT_ONCE | UNSHARED)
    except OSError:
        return False  # not an emulator's link: that of a device, for example
    try:
        lock_now(lock, shared=True)
        # a new lock is still empty, and one of another kind is none
        return os.read(lock, len(LOCK_TEXT) + 1) in (LOCK_TEXT, b"")
    except OSError:
        return False
    finally:
        os.close(lock)
