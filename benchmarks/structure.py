"""The structure of the program in numbers: python benchmarks/structure.py [ROOT [PACKAGE ...]].

For every folder: the modules and folders in it, levels of import, and pairs of them of which one
imports the other. For every package its longest function, in lines from `def` to the end.
"""

import ast
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from graphlib import TopologicalSorter
from pathlib import Path
from typing import Final, NamedTuple

PACKAGES: Final = ("khepera_protocol", "khepera_emulator", "macor_hil")

Graph = Mapping[str, Collection[str]]
"""Imported modules, by the module that imports them."""


class Import(NamedTuple):
    """An import of a module; inside a function it is lazy."""

    module: str
    lazy: bool


def modules_of(root: Path, packages: Sequence[str] = PACKAGES) -> dict[str, Path]:
    """Return the files of all modules of packages, by their dotted names."""
    found = {}
    for package in packages:
        folder = next(
            each for each in (root / package, root / "protocol" / package) if each.is_dir()
        )
        for file in sorted(folder.rglob("*.py")):
            parts = package, *file.relative_to(folder).with_suffix("").parts
            found[".".join(parts).removesuffix(".__init__")] = file
    return found


def imports_of(file: Path, known: Collection[str]) -> list[Import]:
    """Return the imports of a file: of a known module, if the name that is imported is one."""
    return list(_imports(ast.parse(file.read_text("utf-8")), known, lazy=False))


def _imports(node: ast.AST, known: Collection[str], *, lazy: bool) -> Iterator[Import]:
    match node:
        case ast.Import(names=names):
            yield from (Import(name.name, lazy) for name in names)
        case ast.ImportFrom(module=str(source), names=names):
            whole = (f"{source}.{name.name}" for name in names)
            yield from (Import(name if name in known else source, lazy) for name in whole)
    lazy = lazy or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    for child in ast.iter_child_nodes(node):
        yield from _imports(child, known, lazy=lazy)


def graph_of(modules: Mapping[str, Path]) -> Graph:
    """Return which of the modules import which, lazily or not."""
    return {
        name: {each.module for each in imports_of(file, modules)} & (modules.keys() - {name})
        for name, file in modules.items()
    }


def folder_graph(folder: str, graph: Graph) -> dict[str, set[str]]:
    """Return which of the modules and folders in a folder import which."""

    def place(module: str) -> str | None:
        inside = module.removeprefix(f"{folder}.")
        return None if inside == module else f"{folder}.{inside.partition('.')[0]}"

    found: dict[str, set[str]] = {}
    for module, imported in graph.items():
        if own := place(module):
            places = filter(None, map(place, imported))
            found.setdefault(own, set()).update(each for each in places if each != own)
    return found


def folders_of(graph: Graph) -> list[str]:
    """Return the folders that hold modules, in order of their names."""
    parents = {name.rpartition(".")[0] for name in graph}
    return sorted(parents - {""})


def levels_of(graph: Graph) -> int:
    """Return how many levels of import there are: 1, if nothing imports anything.

    Raises:
        CycleError: there is a circle.
    """
    level: dict[str, int] = {}
    for name in TopologicalSorter(graph).static_order():
        level[name] = 1 + max((level[each] for each in graph[name]), default=0)
    return max(level.values(), default=0)


def longest_function(modules: Mapping[str, Path]) -> tuple[int, str]:
    """Return the lines of the longest function, and its name."""
    longest = 0, ""
    for module, file in modules.items():
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                longest = max(longest, (lines, f"{module}.{node.name}"))
    return longest


def main(arguments: Sequence[str]) -> None:
    """Print the tables of a program in Markdown."""
    root = Path(arguments[0]) if arguments else Path(__file__).parent.parent
    packages = arguments[1:] or PACKAGES
    modules = modules_of(root, packages)
    graph = graph_of(modules)
    lines = ["| folder | modules and folders | levels | pairs |", "|---|---|---|---|"]
    for folder in folders_of(graph):
        inside = folder_graph(folder, graph)
        pairs = sum(map(len, inside.values()))
        lines.append(f"| `{folder}` | {len(inside)} | {levels_of(inside)} | {pairs} |")
    lines += ["", "| package | longest function | lines |", "|---|---|---|"]
    for package in packages:
        own = {name: file for name, file in modules.items() if name.split(".")[0] == package}
        count, name = longest_function(own)
        lines.append(f"| `{package}` | `{name}` | {count} |")
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
