"""Hostile inputs, one edge of the product a file: what is bad is refused by its name, and no more.

    pytest tests/hostile                     the short form, part of all tests
    HOSTILE_LONG=1 pytest tests/hostile      the long form, minutes

A test asks `hostile.examples(n)` how many inputs to try, and says by `hostile.count(edge)` that it
has tried one. At the end a table shows how many there were.

    def test_hostile_names(hostile):
        @settings(max_examples=hostile.examples(50))
        @given(st.text())
        def refused_or_taken(text):
            hostile.count("names")
            ...

        refused_or_taken()
"""

from collections.abc import Generator
from pathlib import Path

import pytest
from hostile_inputs import Hostile

HOSTILE = pytest.StashKey[Hostile]()


def pytest_configure(config: pytest.Config) -> None:
    config.stash[HOSTILE] = Hostile()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Give the long form all the time it takes."""
    if config.stash[HOSTILE].long:
        for item in items:
            if item.path.parent == Path(__file__).parent:
                item.add_marker(pytest.mark.timeout(3600))


@pytest.fixture(scope="session")
def hostile(pytestconfig: pytest.Config) -> Hostile:
    return pytestconfig.stash[HOSTILE]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Hand the numbers on with the test's report, which reaches the end of a parallel run, too."""
    report = yield
    tried = item.config.stash[HOSTILE].tried
    report.user_properties.extend(("inputs tried", [edge, n]) for edge, n in tried.items())
    tried.clear()
    return report
