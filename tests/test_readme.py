"""The README: its commands work when pasted."""

import re
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest
from as_type import not_none
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


def description() -> Any:
    """Return the module that makes the package's long description."""
    spec = not_none(spec_from_file_location("description", ROOT / "setup.py"))
    module = module_from_spec(spec)
    not_none(spec.loader).exec_module(module)
    return module


EXAMPLE = """![A maze](docs/maze.png) and [how](docs/maze.md#walls), `x[i](j)`, [there](https://a.org/b).

```python
rows[0](docs/maze.md)
```
"""


def test_a_package_index_gets_absolute_links_at_the_tag() -> None:
    shown = description().for_an_index(EXAMPLE, "https://forge.example/us/khepera", "v1.2.3")
    assert "![A maze](https://forge.example/us/khepera/raw/v1.2.3/docs/maze.png)" in shown
    assert "[how](https://forge.example/us/khepera/blob/v1.2.3/docs/maze.md#walls)" in shown
    for same in ("`x[i](j)`", "[there](https://a.org/b)", "rows[0](docs/maze.md)"):
        assert same in shown


def test_without_an_address_pictures_are_told_and_files_are_named() -> None:
    shown = description().for_an_index(EXAMPLE, None, "v1.2.3")
    assert "*[Picture `docs/maze.png`: A maze]*" in shown
    assert "how [`docs/maze.md#walls`]" in shown
    for same in ("`x[i](j)`", "[there](https://a.org/b)", "rows[0](docs/maze.md)"):
        assert same in shown


def test_no_link_of_this_readme_leads_nowhere_on_a_package_index() -> None:
    for source in (None, "https://forge.example/us/khepera"):
        shown = description().for_an_index(TEXT, source, "v1.2.3")
        assert not re.search(r"\]\((?!https?:|#)", shown)
