"""Hostile inputs, one edge of the product a file: what is bad is refused by its name, and no more.

    pytest tests/hostile                     the short form, part of all tests
    HOSTILE_LONG=1 pytest tests/hostile      the long form, minutes

A test asks `hostile.examples(n)` how many inputs to try, and says by `hostile.count(edge)` that it
has tried one (`count_inputs` is the same function). At the end a table shows how many there were.

    def test_hostile_names(hostile):
        @settings(max_examples=hostile.examples(50))
        @given(st.text())
        def refused_or_taken(text):
            hostile.count("names")
            ...

        refused_or_taken()
"""

import os
from collections import Counter
from pathlib import Path

import pytest

LONGER = 40
"""Times as many inputs in the long form."""


class Hostile:
    """The number of inputs to try, and of those that were tried."""

    def __init__(self):
        self.long = os.environ.get("HOSTILE_LONG") == "1"
        self.tried = Counter()

    def examples(self, number):
        return number * LONGER if self.long else number

    def count(self, edge, number=1):
        self.tried[edge] += number


HOSTILE = pytest.StashKey[Hostile]()


def pytest_configure(config):
    config.stash[HOSTILE] = Hostile()


def pytest_collection_modifyitems(config, items):
    """Give the long form all the time it takes."""
    if config.stash[HOSTILE].long:
        for item in items:
            if item.path.parent == Path(__file__).parent:
                item.add_marker(pytest.mark.timeout(3600))


@pytest.fixture(scope="session")
def hostile(pytestconfig):
    return pytestconfig.stash[HOSTILE]


@pytest.fixture(scope="session")
def count_inputs(hostile):
    return hostile.count


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    """Hand the numbers on with the test's report, which reaches the end of a parallel run, too."""
    report = yield
    tried = item.config.stash[HOSTILE].tried
    report.user_properties.extend(("inputs tried", [edge, n]) for edge, n in tried.items())
    tried.clear()
    return report
