"""A digest of the program text that decides results, so that results of other code never mix.

Comments, docstrings and layout do not count: what is digested is the syntax tree without them.
"""

import ast
from collections.abc import Iterable
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from macor_hil.errors import MacorError

_PACKAGES: Final = ("protocol", "khepera_emulator", "macor_hil")

NO_PART: Final = frozenset(
    {f"khepera_emulator/{name}" for name in ("cli", "daemon", "picture", "side_channel")}
    | {f"khepera_emulator/{name}" for name in ("generator", "layout", "passages")}
    | {f"khepera_emulator/{name}" for name in ("arena_text", "variants")}
    | {f"khepera_emulator/ports/{name}" for name in ("link", "pty", "rfc2217", "tcp", "watch")}
    | {f"macor_hil/{name}" for name in ("cli", "demo", "interruption", "pictures", "service")}
    | {f"macor_hil/{name}" for name in ("experiments", "monitor", "telemetry")}
)
"""Modules and folders that have no part in a drive over a `khepera://` port."""


def digest(arenas: Iterable[str], without: Iterable[str] = ()) -> str:
    """A digest of all code behind drives in some arenas, 12 hexadecimal digits.

    Args:
        arenas: names of arenas that come with the emulator.
        without: further modules and folders that have no part in it.

    Raises:
        MacorError: a package is not installed.
    """
    total = sha256()
    silent = NO_PART.union(without)
    for package in _PACKAGES:
        folder = _folder(package)
        for path in sorted(folder.rglob("*.py")):
            module = path.relative_to(folder.parent).with_suffix("")
            if silent.isdisjoint(str(part) for part in (module, *module.parents)):
                total.update(f"{module}\n{bare_code(path.read_text(encoding='utf-8'))}\n".encode())
    for arena in sorted(arenas):
        total.update(_arena(arena))
    return total.hexdigest()[:12]


@cache
def bare_code(text: str) -> str:
    """The syntax tree of a program text, without comments, docstrings and places."""
    return ast.dump(_WithoutText().visit(ast.parse(text)))


class _WithoutText(ast.NodeTransformer):
    """Drops strings that stand as statements."""

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        """Drop a statement that is a string."""
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return None
        return node


def _arena(name: str) -> bytes:
    shipped = _folder("khepera_emulator") / "arenas" / f"{name}.toml"
    path = shipped if shipped.exists() else Path(name)
    try:
        return path.read_bytes()
    except OSError:
        raise MacorError(f"there is no arena {name!r}") from None


def _folder(package: str) -> Path:
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise MacorError(f"the package {package} is not installed; experiments need the emulator")
    return Path(spec.origin).parent
