"""The documentation: its commands run, its links lead somewhere, what is generated is current."""

import importlib.util
import os
import pydoc
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
from as_type import not_none
from docs_runner import ELSEWHERE, PROGRAMS, ROOT, blocks, elsewhere
from emulator_process import PATIENCE
from typer.testing import CliRunner

from khepera_emulator.app.cli.commands import app as emulator
from macor_hil.cli.program import app as controller

DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
WITH_LINKS = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.rglob("*.md"))]
COMMANDS = (DOCS / "commands.md").read_text("utf-8")
EXAMPLE = re.compile(r" (khepera-emulator|macor-hil) [a-z]")
APPS = {"macor-hil": controller, "khepera-emulator": emulator}
RUNNER = Path(__file__).with_name("docs_runner.py")
PACKAGES = ("khepera_protocol", "khepera_emulator", "macor_hil")
FOLDERS = ("benchmarks", "docker", "docs", "examples", "protocol", "tests", *PACKAGES)
PROGRAM_FILES = [file for folder in FOLDERS for file in (ROOT / folder).rglob("*.py")]
PATH = rf"(?<![\w./-])(?:(?:[\w-]+/)*[\w-]+\.py\b|(?:{'|'.join(FOLDERS)})/[\w./-]*)"
FENCED = re.compile(r"^ *```.*?^ *```", re.DOTALL | re.MULTILINE)
REFERENCE = (
    "khepera_protocol.serial",
    "khepera_protocol.epuck",
    *(f"macor_hil.mind.{folder}" for folder in ("clusterers", "eyes", "foresight")),
    *(f"macor_hil.mind.{folder}" for folder in ("memories", "planners")),
    "macor_hil.hardware.cameras",
)
"""Packages of which every module is in the reference."""

VARIABLE = re.compile(r"[A-Z_]+=")
NETWORK = ["unshare", "--map-root-user", "--net", "--pid", "--fork", "--kill-child"]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"][
    "optional-dependencies"
]


def commands(page: Path) -> list[str]:
    return [c for block in blocks(page) if block.language == "sh" for c in block.commands()]


def names(pages: list[Path]) -> list[str]:
    return [str(page.relative_to(ROOT)) for page in pages]


def has_own_network() -> bool:
    tools = shutil.which("unshare") and shutil.which("ip")
    return bool(tools) and not subprocess.run([*NETWORK, "true"], check=False).returncode


RUNNABLE = [page for page in PAGES if any(not elsewhere(command) for command in commands(page))]


LONG = (
    *("own-planner.md", "tutorial.md", "arenas.md", "testing.md", "watching.md", "faults.md"),
    *("epuck.md", "gymnasium.md", "viewers.md", "by-hand.md", "classroom.md", "service.md"),
)
"""Pages whose commands train, measure or compile for long, or switch many robots on."""


def how_often(page: Path) -> list[pytest.MarkDecorator]:
    return [pytest.mark.long] if page.name in LONG else []


TRIED = [pytest.param(page, marks=how_often(page)) for page in RUNNABLE]


@pytest.mark.timeout(10 * PATIENCE)
@pytest.mark.parametrize("page", TRIED, ids=names(RUNNABLE))
def test_the_commands_of_a_page_run(page: Path, tmp_path: Path) -> None:
    if not has_own_network():
        pytest.skip("the pages' well-known ports need a network namespace (unshare, ip)")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [*NETWORK, sys.executable, RUNNER, page, tmp_path],
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        timeout=8 * PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "code",
    [
        pytest.param(block.text, id=f"{page.name}:{block.line}", marks=how_often(page))
        for page in PAGES
        if page.parent.name == "docs"
        for block in blocks(page)
        if block.language == "python" and not (block.file or "").startswith("test_")
    ],
)
def test_the_python_of_a_page_runs(code: str) -> None:
    # the first of all makes machine code
    subprocess.run([sys.executable, "-c", code], check=True, timeout=3 * PATIENCE)


@pytest.mark.parametrize(
    "command",
    sorted({command for page in PAGES for command in commands(page) if elsewhere(command)}),
)
def test_commands_that_run_elsewhere_are_commands(command: str) -> None:
    program, *arguments = (word for word in shlex.split(command) if not VARIABLE.match(word))
    if program in APPS:
        # where an option is unknown, there is an error instead of help
        done = CliRunner().invoke(APPS[program], [*arguments, "--help"])
        assert done.exit_code == 0, done.output
    elif program == "make":
        subprocess.run(["make", "-n", *arguments], cwd=ROOT, check=True, capture_output=True)
    elif program == "pip":
        for extra in re.findall(r"\.\[([\w,]+)\]", command):
            assert set(extra.split(",")) <= set(EXTRAS)
    else:
        of_pages = {block.file for page in PAGES for block in blocks(page)}
        for file in re.findall(r"[\w/]+\.(?:py|yaml)\b", command):
            assert (ROOT / file).is_file() or file in of_pages


def test_nothing_is_run_elsewhere_that_no_page_shows() -> None:
    shown = [command for page in PAGES for command in commands(page)]
    for what in ELSEWHERE:
        assert any(re.match(what, command) for command in shown), what


@pytest.mark.parametrize("page", PAGES, ids=names(PAGES))
def test_commands_are_marked_as_such(page: Path) -> None:
    for block in blocks(page):
        if not block.language:
            first = {line.removeprefix(".venv/bin/").partition(" ")[0] for line in block.commands()}
            assert not first & set(PROGRAMS), f"line {block.line}: mark the block as sh or text"


@pytest.mark.parametrize("page", PAGES, ids=names(PAGES))
def test_every_block_closes(page: Path) -> None:
    begun = None
    for number, line in enumerate(page.read_text("utf-8").splitlines(), 1):
        if line.lstrip().startswith("```"):
            within = f"line {number} begins a block within that of line {begun}"
            assert begun is None or line.strip() == "```", within
            begun = None if begun else number
    assert begun is None, f"the block of line {begun} never closes"


@pytest.mark.parametrize("page", WITH_LINKS, ids=names(WITH_LINKS))
def test_links_lead_somewhere(page: Path) -> None:
    text = FENCED.sub("", page.read_text("utf-8"))
    for target, anchor in re.findall(r"\]\(([^)#:]*)(?:#([^)]*))?\)", text):
        file = page.parent / target if target else page
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), f"{target}#{anchor}"


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as forges and the site make them."""
    headings = re.findall(r"^#+ (.*)$", FENCED.sub("", page.read_text("utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", each.lower()).strip().replace(" ", "-") for each in headings}


@pytest.mark.parametrize("page", PAGES, ids=names(PAGES))
def test_names_of_code_are_those_of_the_code(page: Path) -> None:
    for code in re.findall(r"`([^`]+)`", FENCED.sub("", page.read_text("utf-8"))):
        for name in re.findall(rf"\b(?:{'|'.join(PACKAGES)})(?:\.\w+)+", code):
            assert pydoc.locate(name) is not None, name
        for path in re.findall(PATH, code):
            there = (ROOT / path).exists() or any(file.match(path) for file in PROGRAM_FILES)
            assert there or path.startswith(("file.py", "my_")), path  # the reader's own


@pytest.mark.parametrize("page", PAGES, ids=names(PAGES))
def test_no_example_leaves_a_robot_driving(page: Path) -> None:
    for block in blocks(page):
        speeds = re.findall(r"D,(-?\d+),(-?\d+)", block.text)
        assert not speeds or speeds[-1] == ("0", "0"), f"line {block.line}"


def test_every_page_is_in_the_index() -> None:
    linked = re.findall(r"\]\(([\w/-]+\.md)\)", (DOCS / "README.md").read_text("utf-8"))
    assert len(linked) == len(set(linked))
    assert {*linked, "README.md"} == {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")}


def test_every_picture_is_on_a_page() -> None:
    shown = {
        (page.parent / picture).resolve()
        for page in WITH_LINKS
        for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", page.read_text("utf-8"))
    }
    kept = {file for kind in ("png", "gif") for file in DOCS.rglob(f"*.{kind}")}
    assert {file.resolve() for file in kept} == shown


@pytest.mark.parametrize("package", REFERENCE)
def test_every_module_is_in_the_reference(package: str) -> None:
    listed = {
        module
        for page in (DOCS / "api").glob("*.md")
        for module in re.findall(r"^\.\. automodule:: ([\w.]+)$", page.read_text("utf-8"), re.M)
    }
    for module in listed:
        assert pydoc.locate(module) is not None, module
    folder = Path(not_none(importlib.import_module(package).__file__)).parent
    modules = {f"{package}.{file.stem}" for file in folder.glob("*.py")}
    assert modules - {f"{package}.__init__"} <= listed


def test_names_that_share_a_text_get_a_field_each_in_the_reference() -> None:
    lines = [
        "A wheel.",
        "",
        ":ivar left, right: metres a count;",
        "             in files, too.",
        "",
    ]
    lines += [":ivar base: metres.", ":param a, b, c: counts."]
    runpy.run_path(str(DOCS / "site" / "conf.py"))["one_by_one"](lines)
    assert lines == [
        *("A wheel.", ""),
        *(":ivar left: metres a count;", "             in files, too.", ""),
        *(":ivar right: metres a count;", "             in files, too.", ""),
        ":ivar base: metres.",
        *(":param a: counts.", ":param b: counts.", ":param c: counts."),
    ]


@pytest.mark.timeout(4 * PATIENCE)
def test_the_pages_of_the_site_build_without_warnings(tmp_path: Path) -> None:
    """The pages alone: `make docs` builds the reference of modules, too, which takes minutes."""
    sphinx = ROOT / ".venv-release" / "bin" / "sphinx-build"
    if not sphinx.exists():
        pytest.skip("Sphinx is not installed; `make docs` installs it")
    command = [str(sphinx), "-q", "-W", "--keep-going", "-b", "dummy", "-c", str(DOCS / "site")]
    command += ["-D", "exclude_patterns=site,api"]
    # pages link to the modules that are left out; that they are there is tested above
    command += ["-D", "suppress_warnings=myst.xref_missing,toc.excluded,toc.not_readable"]
    done = subprocess.run(
        [*command, DOCS, tmp_path],
        capture_output=True,
        text=True,
        timeout=3 * PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_man_pages_show_what_the_help_shows(tmp_path: Path) -> None:
    command = [sys.executable, str(DOCS / "man.py"), str(tmp_path)]
    subprocess.run(command, check=True, timeout=2 * PATIENCE, capture_output=True)
    pages = {
        page.stem: page.read_text("utf-8").replace("\\-", "-") for page in tmp_path.glob("*.1")
    }
    for part in COMMANDS.split("\n### ")[1:]:
        name, _, text = part.partition("\n")
        options = re.findall(r"^│ \*? *(--[a-z0-9-]+)", text.partition("\n## ")[0], re.MULTILINE)
        assert options
        page = pages.pop(name.replace(" ", "-"))
        assert set(options) - {"--help"} <= set(re.findall(r"--[a-z0-9-]+", page))
        # values, defaults and examples, each of these on a line of its own
        assert {f".B {line[1:]}" for line in text.splitlines() if EXAMPLE.match(line)} <= set(
            page.splitlines()
        )
        assert set(re.findall(r"\[default: [^]│]+\]", text)) <= set(
            re.findall(r"\[default: [^]]+\]", page.replace("; ", "] ["))
        )
    assert set(pages) == set(APPS)
    for program, page in pages.items():
        commands = re.findall(rf"^### {program} (.+)$", COMMANDS, re.MULTILINE)
        assert [f".B {each}" for each in commands] == re.findall(
            r"^[.]B [a-z].*$", page.partition(".SH OPTIONS")[0], re.MULTILINE
        )
    assert ".SH EXIT STATUS" in pages["macor-hil"].splitlines()


def generated() -> dict[str, Callable[[], str]]:
    file = ROOT / "docs" / "generate.py"
    spec = not_none(importlib.util.spec_from_file_location("generate", file))
    module = importlib.util.module_from_spec(spec)
    not_none(spec.loader).exec_module(module)
    pages: dict[str, Callable[[], str]] = module.PAGES
    return pages


@pytest.mark.parametrize("name", sorted(generated()))
def test_generated_pages_are_current(name: str) -> None:
    page = generated()[name]()
    assert (ROOT / "docs" / name).read_text("utf-8") == page, "run: python docs/generate.py"
