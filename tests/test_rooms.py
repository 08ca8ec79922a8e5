"""The folders import one way, and each keeps to its subject; `docs/design.md` draws them."""

from collections import Counter
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from structure import folder_graph, folders_of, graph_of, imports_of, modules_of

MODULES = modules_of(Path(__file__).parent.parent)
GRAPH = graph_of(MODULES)

MOST = 14
"""Modules and folders in a folder."""

OPENS_THE_EMULATOR = {
    "macor_hil.cli.common",
    "macor_hil.environment.many",
    "macor_hil.experiments.drives.arena_files",
    "macor_hil.hardware.bench",
    "macor_hil.hardware.line.serial_line",
    "macor_hil.runs.possible",
}
"""Modules of the controller that find the emulator, if it is installed, when they need it."""

IO = {
    *("asyncio", "io", "multiprocessing", "os", "pathlib", "select", "serial", "shutil", "signal"),
    *("socket", "ssl", "subprocess", "sys", "threading", "time", "typer", "urllib", "zenoh"),
}
"""Modules that know files, lines, clocks, threads, a process or its terminal."""

WITH_IO = {
    "khepera_protocol.config_file": {"pathlib", "typer"},
    "khepera_protocol.extras": {"sys", "urllib"},
    "khepera_protocol.logs": {"time"},
    "khepera_protocol.options": {"pathlib", "typer"},
    "khepera_protocol.registry": {"pathlib", "sys"},
    "khepera_protocol.version": {"typer"},
    "macor_hil.mind.map_file": {"io", "pathlib"},
}
"""The only ones that import them, of the mind and of the protocol beside two of its folders."""

SEEN_BY_THE_MIND = {
    "khepera_protocol.system.compiled",
    "khepera_protocol.mirror",
    "khepera_protocol.options",
    "khepera_protocol.registry",
    "khepera_protocol.text",
    "khepera_protocol.validation",
    "macor_hil.arrays",
    "macor_hil.commands",
    "macor_hil.errors",
    "macor_hil.files",
}


def inside(module: str, folder: str) -> bool:
    return module == folder or module.startswith(f"{folder}.")


def imports(folder: str) -> Iterator[tuple[str, str, bool]]:
    """All imports of a folder's modules: who, what, and whether inside a function."""
    for module, file in MODULES.items():
        if inside(module, folder):
            for imported, lazy in imports_of(file, MODULES):
                yield module, imported, lazy


def test_no_module_imports_itself_by_way_of_others() -> None:
    TopologicalSorter(GRAPH).prepare()


@pytest.mark.parametrize("folder", folders_of(GRAPH))
def test_a_folder_is_small_and_has_no_circle(folder: str) -> None:
    graph = folder_graph(folder, GRAPH)
    TopologicalSorter(graph).prepare()
    assert len(graph) <= MOST


def test_packages_import_one_way() -> None:
    def wrong(package: str, *others: str) -> list[tuple[str, str, bool]]:
        return [each for each in imports(package) if each[1].split(".")[0] in others]

    assert not wrong("khepera_protocol", "khepera_emulator", "macor_hil")
    assert not wrong("khepera_emulator", "macor_hil")
    opened = wrong("macor_hil", "khepera_emulator")
    assert all(lazy for _, _, lazy in opened)
    assert {module for module, _, _ in opened} == OPENS_THE_EMULATOR


def test_the_protocol_and_the_mind_have_no_io_but_where_it_is_named() -> None:
    found: dict[str, set[str]] = {}
    for module, imported, _ in [*imports("khepera_protocol"), *imports("macor_hil.mind")]:
        package = imported.split(".")[0]
        outside = inside(module, "khepera_protocol.zenoh")
        outside |= inside(module, "khepera_protocol.system")
        if package in IO and not outside:
            found.setdefault(module, set()).add(package)
    assert found == WITH_IO


def test_the_mind_knows_little_of_the_rest() -> None:
    seen = set()
    for module, imported, _ in imports("macor_hil.mind"):
        if imported in MODULES and not inside(imported, "macor_hil.mind"):
            seen.add(imported)
            assert imported != "macor_hil.files" or module == "macor_hil.mind.map_file"
    assert seen == SEEN_BY_THE_MIND


def test_no_two_files_of_tests_have_one_name() -> None:
    # pytest imports them by their bare names, and stops where one is there twice
    names = Counter(file.name for file in Path(__file__).parent.rglob("*.py"))
    names.subtract(["conftest.py"] * names["conftest.py"])
    assert [name for name, count in names.items() if count > 1] == []
