"""A name for a pseudo-terminal: a symbolic link that one emulator at a time may hold."""

import fcntl
import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Self

from khepera_emulator.errors import EmulatorError
from protocol.terminal_link import lock_beside

_TERMINALS = Path("/dev/pts")

_LOOKS = 5
_PAUSE = 0.01
"""Seconds between two looks at a lock: a client holds it for a moment to see who lives."""


class Link:
    """Claim on a path; use as a context, which takes the link away at its end if it is still ours.

    A lock file beside the link tells whether its emulator lives: the lock goes with the process.

    Args:
        path: where the link shall be; its folder is made if need be.

    Raises:
        EmulatorError: another emulator holds it, or something is there that is no link to a
            terminal, or the folder cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._target: str | None = None
        self._lock_path = lock_beside(path)
        self._check_free()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._lock = self._take_lock()
            # what its last holder left behind may lead to somebody else's terminal by now
            if path.is_symlink():
                path.unlink()
        except OSError as error:
            raise EmulatorError(
                f"cannot make the link {path}: {error.filename}: {error.strerror}"
            ) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def point_to(self, target: str) -> None:
        """Make the link, or turn it, in one step: readers find the old one or the new one."""
        new = self.path.with_name(f"{self.path.name}.{os.getpid()}")
        try:
            new.symlink_to(target)
            new.replace(self.path)
        except OSError as error:
            new.unlink(missing_ok=True)
            raise EmulatorError(f"cannot make the link {self.path}: {error.strerror}") from None
        self._target = target

    def release(self) -> None:
        """Take the link away, unless someone has turned it elsewhere, and give up the claim."""
        if self._target is not None:
            with suppress(OSError):
                if str(self.path.readlink()) == self._target:
                    self.path.unlink()
        self._lock_path.unlink(missing_ok=True)
        os.close(self._lock)

    def _check_free(self) -> None:
        path = self.path
        if path.is_symlink():
            if path.readlink().parent != _TERMINALS:
                raise EmulatorError(
                    f"{path} is a link to {path.readlink()}, not to an emulator's terminal;"
                    " give another --link"
                )
        elif path.exists():
            raise EmulatorError(f"{path} exists and is not a link; give another --link")

    def _take_lock(self) -> int:
        looks = _LOOKS
        while True:
            lock = os.open(self._lock_path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(lock)
                looks -= 1
                if looks > 0:
                    time.sleep(_PAUSE)
                    continue
                raise EmulatorError(
                    f"the link {self.path} is held by an emulator that is running;"
                    " end that one, or give another --link"
                ) from None
            # the holder before may have taken the file away between our opening and locking it
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(lock), self._lock_path.stat()):
                    return lock
            os.close(lock)
