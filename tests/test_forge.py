"""Workflows of the forge call the project's own targets, which can be tried on any machine."""

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).parent.parent
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def steps(file: Path) -> list[dict[str, Any]]:
    jobs = YAML(typ="safe").load(file.read_text("utf-8"))["jobs"]
    return [step for job in jobs.values() for step in job["steps"]]


@pytest.mark.parametrize("file", WORKFLOWS, ids=lambda file: file.stem)
def test_every_step_is_a_target_or_an_action(file: Path) -> None:
    for step in steps(file):
        command = step.get("run", "")
        assert re.fullmatch(r"make [a-z-]+ PYTHON=python", command) or "uses" in step, step
        if command:
            # nothing is built: the targets' rules are printed
            subprocess.run(
                ["make", "-n", *command.split()[1:]], cwd=ROOT, check=True, capture_output=True
            )


def test_tests_run_on_every_python_that_the_package_is_for() -> None:
    classifiers = re.findall(
        r'"Programming Language :: Python :: (3\.\d+)"', (ROOT / "pyproject.toml").read_text()
    )
    jobs = YAML(typ="safe").load((ROOT / ".github/workflows/tests.yml").read_text("utf-8"))["jobs"]
    matrix = jobs["test"]["strategy"]["matrix"]
    assert set(classifiers) <= set(matrix["python"])
    assert set(matrix["system"]) == {"ubuntu", "macos", "windows"}
