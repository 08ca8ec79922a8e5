"""A digest of the code that decides results: other code never finds the results of this one.

What a function may run is found in the source text, without running it: its own module and all
modules of this project that are imported from there on, wherever the import stands. Of its own
module only those definitions count that the function reaches by name, so that an experiment may
draw and tell in the same file. Comments, docstrings and layout do not count: what is digested is
the syntax tree without them.
"""

import ast
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from hashlib import sha256
from importlib.util import find_spec, resolve_name
from pathlib import Path
from typing import Any, Final

from macor_hil.errors import MacorError
from macor_hil.files import MIB, InputError, read_bounded

_PACKAGES: Final = ("khepera_protocol", "khepera_emulator", "macor_hil")

_BY_SCHEME: Final = "khepera_emulator.ports.protocol_khepera"
"""Imported by pySerial, which makes the module's name of a URL's scheme."""

Body = list[ast.stmt]


_DOORS: Final = ("khepera_emulator", "macor_hil.mind.catalogue")
"""Tables of parts: what they lead to counts where it is used, and is given by `uses`."""


def digest(function: Callable[..., Any], arenas: Iterable[str], uses: Iterable[str] = ()) -> str:
    """Return a digest of all that a function may run and of arenas, 12 hexadecimal digits.

    Args:
        function: one at the top level of its module.
        arenas: names of arenas that come with the emulator, or files.
        uses: parts that it finds by name, as `module:Class` or `file.py:Class`.

    Raises:
        MacorError: a package is not installed, or there is no such arena.
    """
    total = sha256()
    for module, code in sorted(code_of(function, uses).items()):
        total.update(f"{module}\n{code}\n".encode())
    for arena in sorted(arenas):
        total.update(_arena(arena))
    return total.hexdigest()[:12]


def code_of(function: Callable[..., Any], uses: Iterable[str] = ()) -> dict[str, str]:
    """Return all that a function may run: bare code by the names of modules.

    Args:
        function: see `digest`.
        uses: see `digest`.

    Raises:
        MacorError: a package is not installed.
    """
    own = function.__module__
    code, imported = _definition(own, _text(own), function.__name__)
    found = {own: code}
    names = {*imported, _BY_SCHEME, own.rpartition(".")[0]}
    todo = [each for name in names for each in _with_parents(name)]
    for place in uses:
        module = place.rpartition(":")[0]
        if module.partition(".")[0] in _PACKAGES:
            todo += _with_parents(module)
        else:
            found[module] = bare_code(_foreign_text(module))
    while todo:
        module = todo.pop()
        if module not in found:
            text = _text(module)
            found[module] = bare_code(text)
            new = _named(module, text) - names
            names |= new
            todo += [each for name in new for each in _with_parents(name)]
    return found


@cache
def _definition(module: str, text: str, name: str) -> tuple[str, frozenset[str]]:
    """Return the bare code that a definition of a module's text reaches, and what it imports."""
    body = _reached(_statements(text), name)
    return _dump(body), frozenset(_names(module, body))


@cache
def bare_code(text: str) -> str:
    """Return the syntax tree of a program text, without comments, docstrings and places."""
    return _dump(_statements(text))


def _dump(body: Body) -> str:
    return ast.dump(ast.Module(body, []))


class _WithoutText(ast.NodeTransformer):
    """Drops strings that stand as statements, and what is there for type checkers alone."""

    def visit_If(self, node: ast.If) -> ast.If | None:
        """Drop `if TYPE_CHECKING:`, which never runs."""
        if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING" and not node.orelse:
            return None
        self.generic_visit(node)
        return node

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        """Drop a statement that is a string."""
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return None
        return node


@cache
def _statements(text: str) -> Body:
    tree: ast.Module = _WithoutText().visit(ast.parse(text))
    return tree.body


def _foreign_text(module: str) -> str:
    """Return the text of a part's file or module that is not of this project."""
    spec = None if module.endswith(".py") else find_spec(module)
    path = Path(spec.origin) if spec and spec.origin else Path(module).expanduser()
    try:
        return read_bounded(path, MIB).decode()
    except (OSError, InputError, UnicodeDecodeError):
        raise MacorError(f"cannot read the code of {module}") from None


def _text(module: str) -> str:
    path = _path(module)
    assert path is not None
    return path.read_text(encoding="utf-8")


@cache
def _named(module: str, text: str) -> frozenset[str]:
    return frozenset(_names(module, _statements(text)))


def _names(module: str, body: Body) -> Iterator[str]:
    """Return the names in this project's packages that statements of a module import.

    A string that names a module, or `module:something`, is taken for an import, too: that is how
    tables of what is loaded later are written.
    """
    package = module if _is_package(module) else module.rpartition(".")[0]
    for statement in body:
        for node in ast.walk(statement):
            match node:
                case ast.Import(names=names):
                    found = [name.name for name in names]
                case ast.ImportFrom(module=source, names=names, level=level):
                    source = resolve_name("." * level + (source or ""), package)
                    found = [f"{source}.{name.name}" for name in names]
                case ast.Constant(value=str(text)) if module not in _DOORS:
                    found = [text.partition(":")[0]]
                case _:
                    continue
            yield from (name for name in found if name.partition(".")[0] in _PACKAGES)


def _with_parents(name: str) -> Iterator[str]:
    """Return a module, or the one that a thing is in, and the packages around it; none: others'."""
    parts = name.split(".")
    if parts[0] in _PACKAGES:
        for end in range(1, len(parts) + 1):
            module = ".".join(parts[:end])
            if _path(module) is not None:
                yield module


def _reached(body: Body, name: str) -> Body:
    """Return the statements that a definition needs, and those that define nothing."""
    statements = [part for statement in body for part in _single(statement)]
    by_name: dict[str, Body] = {}
    todo, reached = {name}, set[int]()
    for statement in statements:
        names = _defined(statement)
        for defined in names:
            by_name.setdefault(defined, []).append(statement)
        if not names:
            todo |= _used(statement)
            reached.add(id(statement))
    seen = set[str]()
    while todo:
        seen.add(wanted := todo.pop())
        for statement in by_name.get(wanted, []):
            reached.add(id(statement))
            todo |= _used(statement) - seen
    return [statement for statement in statements if id(statement) in reached]


def _single(statement: ast.stmt) -> Body:
    """Return an import of several names as one of each; other statements as they are."""
    match statement:
        case ast.ImportFrom(module=module, names=names, level=level):
            return [ast.ImportFrom(module, [name], level) for name in names]
        case ast.Import(names=names):
            return [ast.Import([name]) for name in names]
    return [statement]


def _defined(statement: ast.stmt) -> set[str]:
    match statement:
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
            return {name}
        case ast.Import(names=[name]) | ast.ImportFrom(names=[name]) if name.name != "*":
            return {name.asname or name.name.partition(".")[0]}
        case ast.Assign(targets=targets):
            return {name for target in targets for name in _stored(target)}
        case ast.AnnAssign(target=target) | ast.AugAssign(target=target):
            return _stored(target)
    return set()


def _stored(target: ast.expr) -> set[str]:
    """Return the names that a target gives a value; a subscript or an attribute gives none."""
    nodes = [node for node in ast.walk(target) if isinstance(node, ast.Name)]
    return {node.id for node in nodes if isinstance(node.ctx, ast.Store)}


def _used(statement: ast.stmt) -> set[str]:
    return {node.id for node in ast.walk(statement) if isinstance(node, ast.Name)}


def _is_package(module: str) -> bool:
    path = _path(module)
    return path is not None and path.name == "__init__.py"


def _path(module: str) -> Path | None:
    """Return the file of a module of this project; None if there is none of that name."""
    package, _, rest = module.partition(".")
    return _file(_folder(package), rest)


@cache
def _file(folder: Path, module: str) -> Path | None:
    rest = module.split(".") if module else []
    place = folder.joinpath(*rest)
    if (inside := place / "__init__.py").is_file():
        return inside
    file = place.with_suffix(".py")
    return file if rest and file.is_file() else None


def _arena(name: str) -> bytes:
    shipped = _folder("khepera_emulator") / "arenas" / f"{name}.toml"
    path = shipped if shipped.exists() else Path(name)
    try:
        return read_bounded(path, MIB)
    except (OSError, InputError):
        raise MacorError(f"there is no arena {name!r}") from None


@cache
def _folder(package: str) -> Path:
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise MacorError(f"the package {package} is not installed; experiments need the emulator")
    return Path(spec.origin).parent
