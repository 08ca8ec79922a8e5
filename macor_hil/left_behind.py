"""Links to terminals of emulators that are gone."""

import fcntl
import os
from pathlib import Path

from protocol.terminal_link import lock_beside


def left_behind(path: Path) -> bool:
    """Whether a path is a link that an emulator made, which has ended without taking it away.

    The number of a terminal goes to whoever asks for one next: behind such a link may be another
    robot, or somebody's shell.
    """
    if not path.is_symlink():
        return False
    try:
        lock = os.open(lock_beside(path), os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return False  # not an emulator's link: that of a device, for example
    try:
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(lock)
    return True
