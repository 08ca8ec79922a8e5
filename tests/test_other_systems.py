"""Everything but the pseudo-terminal works where the system has none; see `other_system`."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

PROGRAM = Path(__file__).with_name("other_system.py")


@pytest.mark.parametrize("part", ["import", "drive", "serve"])
def test_what_windows_lacks_is_not_needed(part: str, tmp_path: Path) -> None:
    words = [part, str(tmp_path)] if part == "drive" else [part]
    done = subprocess.run(
        [sys.executable, str(PROGRAM), *words], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
