"""The plugin of pytest, in the tests of somebody else."""

import subprocess
import sys
import tomllib
from importlib.metadata import entry_points
from pathlib import Path
from xml.etree import ElementTree

import pytest
from emulator_process import PATIENCE, has_ended

# a run in this process forgets its imports again, and NumPy does not load twice
from khepera_emulator.app.testing import plugin, report, started  # noqa: F401

pytest_plugins = ["pytester"]

NAME = "khepera"
INSTALLED = NAME in entry_points(group="pytest11").names
OPTIONS = () if INSTALLED else ("-p", plugin.__name__)
"""An installation from before the entry point, or none, has to be told of the plugin."""

QUIET = ("-p", "no:randomly", "-W", "ignore::pytest.PytestAssertRewriteWarning")

ROBOTS = """
import pytest, serial

def ask(port, request):
    with serial.Serial(port, timeout=30) as line:
        line.write(request)
        return line.readline()

@pytest.mark.khepera(arena="open-box", seed=3)
class TestMarked:
    def test_passes(self, khepera):
        assert ask(khepera.port, b"B\\n") == b"b,5.01,5.00\\r\\n"
        assert khepera.place(0.1, 0.0, 1.5).pose.x == 0.1

    @pytest.mark.khepera(fault=["stray:p=1,text=oh"])
    def test_fails(self, khepera):
        assert ask(khepera.port, b"G,7,8\\n") == b"g\\r\\n"
"""

URLS = """
import pytest, serial

def test_default(khepera_url, pytestconfig):
    model = pytestconfig.getoption("khepera_model")
    assert khepera_url == "khepera://corridor" + (f"?model={model}" if model else "")
    with serial.serial_for_url(khepera_url, timeout=1) as line:
        line.write(b"B\\n")
        assert line.readline() == (b"b,5.02,5.01\\r\\n" if model else b"b,5.01,5.00\\r\\n")

@pytest.mark.khepera(arena="maze", seed=5, model="khepera", speed=3)
@pytest.mark.parametrize("word", ["drop"])
def test_marked(khepera_url, word):
    assert khepera_url == "khepera://maze?seed=5"
"""

REFUSED = """
import pytest

@pytest.mark.khepera(faults=["drop"])
def test_unknown(khepera): ...

@pytest.mark.khepera("maze")
def test_nameless(khepera): ...

@pytest.mark.khepera(seed="x")
def test_bad(khepera_url): ...
"""

INTERRUPTED = """
from pathlib import Path

def test_long(khepera):
    Path("pid").write_text(str(khepera.pid))
    raise KeyboardInterrupt
"""


@pytest.fixture
def run(pytester: pytest.Pytester) -> "Run":
    pytester.makeini("[pytest]\naddopts = --strict-markers\n")
    return Run(pytester)


class Run:
    """Runs a test file of somebody else."""

    def __init__(self, pytester: pytest.Pytester) -> None:
        self._pytester = pytester

    def __call__(self, text: str, *options: str, inside: bool = True) -> pytest.RunResult:
        """Run it in this process, or in one of its own."""
        self._pytester.makepyfile(text)
        way = self._pytester.runpytest_inprocess if inside else self._pytester.runpytest_subprocess
        return way(*QUIET, *OPTIONS, *options)

    @property
    def folder(self) -> Path:
        return self._pytester.path


def test_a_robot_is_there_and_a_failure_shows_its_line(run: Run) -> None:
    result = run(ROBOTS, "--junitxml=report.xml")
    result.assert_outcomes(passed=1, failed=1)
    (failure,) = ElementTree.parse(run.folder / "report.xml").iter("failure")
    assert r"request  'G,7,8\n'" in str(failure.text)
    lines = [line for line in result.outlines if " s  " in line]
    result.stdout.fnmatch_lines(["*- Khepera's line -*", "(*/khepera1/wire.jsonl)"])
    assert [line.split("  ")[-1].strip() for line in lines] == [
        "9600 8N1",
        r"'G,7,8\n'",
        "reply stray: b'oh'",
        r"'ohg\r\n'",
    ] + (["close"] if "close" in lines[-1] else [])


@pytest.mark.long
def test_it_works_with_xdist(run: Run) -> None:
    result = run(ROBOTS, "-n", "2")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["*- Khepera's line -*", r"*request  'G,7,8\n'*"])


def test_its_url_has_the_options_of_marks_and_of_the_command_line(run: Run) -> None:
    run(URLS).assert_outcomes(passed=2)
    run(URLS, "--khepera-model", "khepera2").assert_outcomes(passed=2)


def test_an_option_that_is_none_fails_the_test_in_a_sentence(run: Run) -> None:
    result = run(REFUSED)
    result.assert_outcomes(errors=3)
    result.stdout.fnmatch_lines(
        [
            "there is no robot: unknown option 'faults'; did you mean fault?*",
            "the mark khepera takes options by their names: khepera(arena=...)",
            "there is no robot: seed should be a valid integer*",
        ]
    )
    assert "Traceback" not in result.stdout.str()
    assert "During handling" not in result.stdout.str()


def test_the_command_line_names_the_arena(run: Run) -> None:
    result = run("def test(khepera_url): assert khepera_url == 'x'", "--khepera-arena", "maze")
    result.stdout.fnmatch_lines(["E*'khepera://maze' == 'x'*"])


def test_an_interrupted_test_leaves_no_robot(run: Run) -> None:
    assert run(INTERRUPTED, inside=False).ret == pytest.ExitCode.INTERRUPTED
    assert has_ended(int((run.folder / "pid").read_text()))


def test_its_options_and_its_mark_are_described(run: Run) -> None:
    result = run("", "--markers")
    result.stdout.fnmatch_lines(["@pytest.mark.khepera(arena=..., seed=..., fault=*"])
    result = run("", "--help")
    result.stdout.fnmatch_lines(["emulated Khepera robots:", "*--khepera-arena=ARENA*"])


def test_it_imports_next_to_nothing() -> None:
    program = (
        "import sys, pytest\n"
        "before = set(sys.modules)\n"
        f"import {plugin.__name__}\n"
        "print(*set(sys.modules) - before)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        timeout=PATIENCE,
    )
    new = {name.partition(".")[0] for name in done.stdout.split()}
    assert new <= {"khepera_emulator", "serial", "fcntl", "select", "termios", "struct", "_struct"}


def test_pytest_finds_it_where_the_distribution_is_installed() -> None:
    project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text("utf-8"))
    assert project["project"]["entry-points"]["pytest11"] == {NAME: plugin.__name__}
