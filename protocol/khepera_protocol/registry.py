"""Doors: parts found by name, in this project, in other distributions, or in a file of one's own.

A part is named as `graded` (built in, or an entry point of an installed distribution),
`package.module:Class`, or `path/to/file.py:Class`. Nothing is imported before it is asked for.
"""

import importlib
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any
from zlib import crc32

from khepera_protocol.text import did_you_mean, printable, quoted


class RegistryError(LookupError):
    """A part cannot be found or loaded; the message is one sentence."""


@dataclass(frozen=True)
class Registry:
    """Parts of one kind.

    Attributes:
        kind: noun for messages, such as `planner`.
        group: entry-point group that other distributions use, such as `khepera_macor.planners`.
        builtin: `package.module:Class` of each part of this project by its name.
    """

    kind: str
    group: str
    builtin: Mapping[str, str]

    def names(self) -> tuple[str, ...]:
        """List all names: built-in parts first, then those of other distributions."""
        return (*self.builtin, *sorted(set(self._installed()) - set(self.builtin)))

    def where(self, name: str) -> str:
        """Return where a part is, as `module:Class` or `file.py:Class`; nothing is imported.

        Raises:
            RegistryError: there is no such part.
        """
        if name in self.builtin:
            return self.builtin[name]
        if is_own_code(name):
            return name
        installed = self._installed()
        if name in installed:
            return installed[name].value
        hint = did_you_mean(name, self.names())
        raise RegistryError(
            f"there is no {self.kind} {quoted(name, 80)}; {hint}there are"
            f" {', '.join(self.names())}; or name a class as module:Class or file.py:Class"
        )

    def find(self, name: str) -> Any:
        """Load a part: a class, or whatever else the name leads to.

        Raises:
            RegistryError: there is no such part, or its module cannot be imported.
        """
        module_name, _, attribute = self.where(name).rpartition(":")
        try:
            if module_name.endswith(".py"):
                found: Any = _module_of_file(Path(module_name))
            else:
                found = importlib.import_module(module_name)
            for part in attribute.split("."):
                found = getattr(found, part)
        except (
            ImportError,
            AttributeError,
            SyntaxError,
            OSError,
            ValueError,
            TypeError,  # of a module's name that begins with a dot
        ) as error:
            what, why = printable(name, 200), printable(str(error), 300)
            raise RegistryError(f"cannot load the {self.kind} {what!r}: {why}") from error
        return found

    def _installed(self) -> dict[str, EntryPoint]:
        points = _entry_points(tuple(sys.path)).select(group=self.group)
        return {point.name: point for point in points}


def is_own_code(name: str) -> bool:
    """Tell whether a name is that of a file or a module, which runs when the part is loaded."""
    return ":" in name


@lru_cache(maxsize=1)
def _entry_points(_path: tuple[str, ...]) -> Any:  # of one type in 3.11, of another since
    """Return the entry points of all distributions; they are read once a search path."""
    return entry_points()


def _module_of_file(path: Path) -> ModuleType:
    """Import a file under a name of its own, once a process."""
    path = path.expanduser().resolve()
    name = f"file_{path.stem}_{crc32(str(path).encode()):08x}"
    if name in sys.modules:
        return sys.modules[name]
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise ImportError(f"there is no Python file {path}")
    module = module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickle look a class's module up there
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
