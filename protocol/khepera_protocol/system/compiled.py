"""Compiled forms of inner loops, for where Numba is installed; without it the plain forms run.

A compiled form gives what its plain form gives, bit for bit, so that nobody has to know which of
both runs. Compiled functions stand in modules of their own, which `load` imports when there is
enough to do: Numba takes most of a second to import. Machine code is kept beside the source (or
where Numba finds room, see NUMBA_CACHE_DIR) and made anew when the source changes.

The variable KHEPERA_COMPILED decides for a process: `never`, `always`, or `auto`, which waits until
the plain form has taken longer than loading does.
"""

import os
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, Final, TypeVar

NEVER: Final = "never"
ALWAYS: Final = "always"

VARIABLE: Final = "KHEPERA_COMPILED"

_LITTLE: Final = 8

_F = TypeVar("_F", bound=Callable[..., Any])


@cache
def is_installed() -> bool:
    """Tell whether there is something to compile with."""
    return find_spec("numba") is not None


class PlainRuns:
    """Count of a process's runs of a plain form, after some of which the compiled one is loaded.

    Args:
        most: runs that take about as long as importing Numba does.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._done = 0

    def are_enough(self) -> bool:
        """Count one more; tell whether the compiled form is to be used for it instead."""
        choice = os.environ.get(VARIABLE)
        if choice == NEVER:
            return False
        self._done += 1
        # where Numba is there already, little is left to load
        most = self._most // _LITTLE if "numba" in sys.modules else self._most
        return (choice == ALWAYS or self._done > most) and is_installed()


_OPTIONS: Final[dict[str, Any]] = {
    # divisions by zero are no errors, as in C
    "error_model": "numpy",
    # the lock of the interpreter is not held
    "nogil": True,
    "no_cfunc_wrapper": True,
}


@cache
def load(module: str) -> ModuleType:
    """Import a module of compiled functions, and those that it imports.

    Raises:
        ImportError: Numba is not installed; see `wanted`.
    """
    spec = find_spec(module)
    if spec is not None and spec.origin is not None:
        _forget_stale(Path(spec.origin).parent)
    return import_module(module)


def compiled(function: _F) -> _F:
    """Compile a function when it is first called; for modules that `load` imports."""
    # its types declare fewer options than it has
    numba: Any = import_module("numba")
    made: _F = numba.njit(cache=True, **_OPTIONS)(function)
    return made


def part(function: _F) -> _F:
    """Compile a function that compiled functions alone call, which takes less time."""
    numba: Any = import_module("numba")
    made: _F = numba.njit(no_cpython_wrapper=True, **_OPTIONS)(function)
    return made


def _forget_stale(folder: Path) -> None:
    """Take away machine code older than any source beside it: a function contains those it calls.

    Numba itself looks at the file of a function only, and not at those of what it calls.
    """
    newest = max(source.stat().st_mtime for source in folder.glob("*.py"))
    for index in folder.glob("__pycache__/*.nbi"):
        try:
            if index.stat().st_mtime < newest:
                index.unlink()
        except OSError:  # another process was faster, or the folder is not ours to write to
            continue
