"""Docstrings say what a thing is or does; `ruff` asks those of functions to begin with a verb."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
FOLDERS = ("protocol", "khepera_emulator", "macor_hil", "benchmarks", "tests", "docs", "examples")

QUESTION = re.compile(r'"""(What|Where|Whether|Which|Who|Whom|Whose|Why|How|When)\b.*')


def test_no_docstring_begins_with_a_question() -> None:
    found = []
    for folder in FOLDERS:
        for file in sorted((ROOT / folder).rglob("*.py")):
            text = file.read_text("utf-8")
            found += [f"{file.relative_to(ROOT)}: {each[0]}" for each in QUESTION.finditer(text)]
    assert not found
