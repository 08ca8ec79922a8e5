"""Loading PyBullet, without its greeting."""

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from khepera_protocol.extras import how_to_install

from khepera_emulator.errors import EmulatorError

_STDERR: Final = 2

_log = logging.getLogger(__name__)


def load_physics() -> None:
    """Import PyBullet; its C code greets on the standard error output, which is closed to it.

    Raises:
        EmulatorError: it is not installed.
    """
    with _silent():
        try:
            import pybullet
        except ModuleNotFoundError:
            raise EmulatorError(
                "the emulator needs PyBullet; install the extra 'emulator' with:"
                f" {how_to_install('emulator')}"
            ) from None
    if not pybullet.isNumpyEnabled():
        _log.info("this PyBullet was built without NumPy: it draws things, not walls, more slowly")


@contextmanager
def _silent() -> Iterator[None]:
    """Let nothing be said on the standard error output, if there is one."""
    try:
        kept = os.dup(_STDERR)
    except OSError:  # a parent has closed it
        yield
        return
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), _STDERR)
    try:
        yield
    finally:
        os.dup2(kept, _STDERR)
        os.close(kept)
