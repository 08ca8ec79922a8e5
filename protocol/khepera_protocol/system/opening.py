"""Flags of `os.open`, where the system has them."""

import os
from typing import Final


def _flag(name: str) -> int:
    value: int = getattr(os, name, 0)
    return value


AT_ONCE: Final = _flag("O_NONBLOCK")
"""Opening a named pipe does not wait for its other end."""

UNSHARED: Final = _flag("O_CLOEXEC")
"""Programs that are started do not get it."""

NO_LINK: Final = _flag("O_NOFOLLOW")
"""A symbolic link is refused."""

BYTES: Final = _flag("O_BINARY")
"""Line ends stay as they are."""
