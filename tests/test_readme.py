"""The README: its commands work when pasted."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from controller_helpers import a_decision, publishing
from emulator_process import PATIENCE, free_endpoint
from khepera_protocol.zenoh.config import CONTROLLER_ENDPOINT

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text("utf-8")


def python_blocks() -> list[str]:
    return re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


def test_the_robot_in_a_url_answers() -> None:
    (code,) = [block for block in python_blocks() if "khepera://" in block]
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, check=True
    )
    replies = done.stdout.splitlines()
    assert [reply[:3] for reply in replies] == ["b'b", "b'n", "b'd", "b'h", "b'd"]


def test_the_ten_line_subscriber_prints_decisions() -> None:
    (code,) = [block for block in python_blocks() if "declare_subscriber" in block]
    assert len(code.splitlines()) <= 12
    assert CONTROLLER_ENDPOINT in code
    endpoint = free_endpoint()
    code = code.replace(CONTROLLER_ENDPOINT, endpoint)
    with publishing(endpoint) as (session, publisher):
        watched = session.declare_publisher("macor/khepera/decision")
        with subprocess.Popen(
            [sys.executable, "-u", "-c", code], stdout=subprocess.PIPE, text=True
        ) as watcher:
            try:
                listener = watched.declare_matching_listener()
                assert listener.recv().matching
                publisher.decision(a_decision(5))
                assert watcher.stdout is not None
                assert watcher.stdout.readline() == "5 straight 0.7\n"
            finally:
                watcher.kill()


@pytest.mark.parametrize("path", sorted(set(re.findall(r"\]\(([^)#:]+)\)", TEXT))))
def test_what_it_points_to_is_there(path: str) -> None:
    assert (ROOT / path).exists()
