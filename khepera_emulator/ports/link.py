"""A name for a pseudo-terminal: a symbolic link that one emulator at a time may hold.

Files of others are left alone: a link is replaced only if an emulator's lock stands beside it, and
nothing is removed but what this process has made or an emulator that is gone has left behind.
"""

import secrets
import time
from contextlib import suppress
from pathlib import Path
from typing import Self

from khepera_protocol.system.lock_file import NotALockError, give_back_lock, take_lock
from khepera_protocol.system.terminal_link import LOCK_TEXT, lock_beside
from khepera_protocol.text import printable

from khepera_emulator.errors import EmulatorError
from khepera_emulator.ports.paths import check_name

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
        check_name("--link", path)
        self.path = path
        self._target: str | None = None
        self._lock_path = lock_beside(path)
        try:
            self._check_free()
            path.parent.mkdir(parents=True, exist_ok=True)
            self._lock = self._take_lock()
            # what its last holder left behind may lead to somebody else's terminal by now
            if path.is_symlink():
                path.unlink()
        except OSError as error:
            raise EmulatorError(
                f"cannot make the link {printable(str(path), 100)}: {error.strerror};"
                " give another --link"
            ) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def point_to(self, target: str) -> None:
        """Make the link, or turn it, in one step: readers find the old one or the new one."""
        new = self.path.with_name(f"{self._lock_path.name}.{secrets.token_hex(8)}")
        try:
            new.symlink_to(target)
            try:
                new.replace(self.path)
            except OSError:
                new.unlink()
                raise
        except OSError as error:
            raise EmulatorError(f"cannot make the link {self.path}: {error.strerror}") from None
        self._target = target

    def release(self) -> None:
        """Take the link away, unless someone has turned it elsewhere, and give up the claim."""
        with suppress(OSError):
            if self._target is not None and str(self.path.readlink()) == self._target:
                self.path.unlink()
        give_back_lock(self._lock_path, self._lock)

    def _check_free(self) -> None:
        path = self.path
        if path.is_symlink():
            target = path.readlink()
            if target.parent != _TERMINALS:
                raise _taken(path, f"is a link to {target}, not to an emulator's terminal")
            if not self._lock_path.exists():
                raise _taken(path, f"is a link to {target} that no emulator has made")
        elif path.exists():
            raise _taken(path, "exists and is not a link")

    def _take_lock(self) -> int:
        for look in range(1, _LOOKS + 1):
            try:
                return take_lock(self._lock_path, LOCK_TEXT)
            except BlockingIOError:
                if look < _LOOKS:
                    time.sleep(_PAUSE)
            except NotALockError:
                raise _taken(
                    self._lock_path, "stands where the link's lock belongs and is none"
                ) from None
        raise EmulatorError(
            f"the link {self.path} is held by an emulator that is running;"
            " end that one, or give another --link"
        )


def _taken(path: Path, why: str) -> EmulatorError:
    return EmulatorError(printable(f"{path} {why}; give another --link"))
