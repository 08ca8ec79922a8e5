"""Compiled forms of inner loops, for where Numba is installed; without it the plain forms run.

A compiled form gives what its plain form gives, bit for bit, so that nobody has to know which of
both runs. Compiled functions stand in modules of their own, which `load` imports when there is
enough to do: Numba takes most of a second to import. Machine code is kept beside the source (or
where Numba finds room, see NUMBA_CACHE_DIR) and made anew when the source changes.

The variable KHEPERA_COMPILED decides for a process: `never`, `always`, or `auto`, which waits until
the plain form has taken longer than loading does, in a short time: a robot in real time, which
loading would halt, goes on with the plain form. Machine code that is not there yet is then made by
another process, and the plain form runs on until it is there; with `always` it is waited for.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from time import monotonic
from types import ModuleType
from typing import Any, Final, TypeVar

NEVER: Final = "never"
ALWAYS: Final = "always"
AUTO: Final = "auto"

VARIABLE: Final = "KHEPERA_COMPILED"

_LITTLE: Final = 8

_BUSY: Final = 20.0
"""Seconds within which the plain form must have taken as long as loading does."""

_POLITE: Final = 10
"""By which making machine code is less urgent than what runs meanwhile."""

_F = TypeVar("_F", bound=Callable[..., Any])


@cache
def is_installed() -> bool:
    """Tell whether there is something to compile with."""
    return find_spec("numba") is not None


class Kernel:
    """A compiled function, which runs instead of its plain form where that pays.

    Where its machine code is not kept yet, it takes longer to make than most programs run the plain
    form for: another process makes it meanwhile.

    Args:
        place: as `module:function`.
        most: runs of the plain form that take about as long as importing Numba does.
    """

    def __init__(self, place: str, most: int) -> None:
        self._module, _, self._name = place.partition(":")
        self._most = most
        self._plain_runs = 0
        self._since = 0.0
        self._due = False
        self._function: Any = None
        self._maker: subprocess.Popen[bytes] | None = None
        self._made = False

    def pays(self, *arguments: Any) -> bool:
        """Tell whether to call it with such arguments; if not, the plain form is to be run."""
        return self.is_due() and self.is_made(*arguments)

    def is_due(self) -> bool:
        """Count one more run; tell whether the plain form has been run often enough of late."""
        choice = os.environ.get(VARIABLE)
        if choice == NEVER or not is_installed():
            return False
        if choice != ALWAYS and not self._due:
            self._count()
        return choice == ALWAYS or self._due

    def _count(self) -> None:
        """Count one more run of the plain form; those of long ago do not count."""
        if self._plain_runs == 0:
            self._since = monotonic()
        self._plain_runs += 1
        # where Numba is there already, little is left to load
        most = self._most // _LITTLE if "numba" in sys.modules else self._most
        if self._plain_runs > most:
            self._due = monotonic() - self._since < _BUSY
            self._plain_runs = 0

    def is_made(self, *arguments: Any) -> bool:
        """Tell whether there is machine code for such arguments, which is made meanwhile."""
        if os.environ.get(VARIABLE) == ALWAYS:
            return True
        if not self._made:
            if self._maker is None and not self._is_kept():
                with suppress(OSError):  # no process is to be had: it is made here
                    self._maker = _start_maker(self._module, self._name, arguments)
            self._made = self._maker is None or self._maker.poll() is not None
        return self._made

    def __call__(self, *arguments: Any) -> Any:
        """Run it."""
        if self._function is None:
            self._function = getattr(load(self._module), self._name)
        return self._function(*arguments)

    def _is_kept(self) -> bool:
        """Tell whether machine code is kept from before."""
        self._function = getattr(load(self._module), self._name)
        kept = Path(self._function.stats.cache_path)
        return any(kept.glob(f"{self._module.rpartition('.')[2]}.{self._name}-*.nbi"))


def _start_maker(module: str, name: str, arguments: tuple[Any, ...]) -> subprocess.Popen[bytes]:
    """Let a process of its own call a compiled function, which keeps the machine code."""
    maker = subprocess.Popen(
        [sys.executable, "-P", "-c", f"from {__name__} import make; make()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    assert maker.stdin is not None
    with suppress(BrokenPipeError), maker.stdin as pipe:
        pipe.write(pickle.dumps((module, name, arguments)))
    return maker


def make() -> None:
    """Call the function that standard input names, with the arguments from there."""
    if hasattr(os, "nice"):
        os.nice(_POLITE)
    module, name, arguments = pickle.load(sys.stdin.buffer)  # of the process that it was started by
    getattr(load(module), name)(*arguments)


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
