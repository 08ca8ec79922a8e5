"""A lock on an open file, which goes with the process, however that ends."""

import os
from typing import Final

_FAR: Final = 1 << 30
"""Place of the byte that is locked on Windows, where others cannot read what is locked."""


def lock_now(descriptor: int, *, shared: bool = False) -> None:
    """Lock an open file, or a folder, without waiting.

    Args:
        descriptor: of the file.
        shared: others may hold it, too, if they share it; Windows knows exclusive locks only.

    Raises:
        BlockingIOError: somebody holds it.
        OSError: it cannot be locked.
    """
    try:
        import fcntl
    except ImportError:
        _lock_on_windows(descriptor)
        return
    kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
    fcntl.flock(descriptor, kind | fcntl.LOCK_NB)


def _lock_on_windows(descriptor: int) -> None:
    import msvcrt

    before = os.lseek(descriptor, 0, os.SEEK_CUR)
    os.lseek(descriptor, _FAR, os.SEEK_SET)
    try:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
    except PermissionError as error:
        raise BlockingIOError(error.errno, error.strerror) from None
    finally:
        os.lseek(descriptor, before, os.SEEK_SET)
