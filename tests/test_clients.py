"""The programs of docs/testing.md in C, Java and Python, and the test that the page writes."""

import os
import shutil
import sys
from pathlib import Path

import pytest
from docs_runner import ROOT, blocks
from test_plugin import OPTIONS

pytest_plugins = ["pytester"]

NEEDS = {"c": "gcc", "java": "java", "python": "python"}


@pytest.fixture
def folder(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files of the page, for a Python that has pySerial."""
    path = os.environ.get("PATH", "")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{path}")
    for block in blocks(ROOT / "docs" / "testing.md"):
        if block.file:
            (pytester.path / block.file).write_text(block.text, "utf-8")
    return pytester.path


@pytest.mark.long
@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("language", NEEDS)
def test_a_client_stops_in_time(pytester: pytest.Pytester, language: str) -> None:
    if shutil.which(NEEDS[language]) is None:
        pytest.skip(f"the client in {language} needs {NEEDS[language]}, which is not here")
    test = f"test_approach.py::test_it_stops_in_time[{language}]"
    pytester.runpytest_subprocess(*OPTIONS, test).assert_outcomes(passed=1)


@pytest.mark.usefixtures("folder")
def test_the_python_client_stops_in_virtual_time(pytester: pytest.Pytester) -> None:
    test = "test_approach.py::test_it_stops_in_time_where_time_is_virtual"
    pytester.runpytest_subprocess(*OPTIONS, test).assert_outcomes(passed=1)


def test_the_page_has_a_client_in_each_language(folder: Path) -> None:
    assert {file.name for file in folder.iterdir()} >= {"approach.c", "Approach.java"}
    page = (ROOT / "docs" / "testing.md").read_text("utf-8")
    assert all(f'"{language}": "' in page for language in NEEDS)
